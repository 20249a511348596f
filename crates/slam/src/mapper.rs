use crate::climbing::Stance;
use crate::elevation::{estimate_elevations, forget_ground};
use crate::front_end::{FrontEnd, Localisation};
use crate::integrity::{Integrity, Verdict, WitnessScan, bridge};
use crate::loop_closing::{LandmarkCloser, LoopCloser, relate};
use crate::map::Map;
use crate::preparation::{Preparation, PreparedObservation};
use crate::refit::{Memory, optimise_relations, refit, relocalise};
use crate::sightings::note_sightings;
use crate::statistics::Statistics;
use crate::track::{ScanPose, ScanRecord};
use crate::{
    BadStretch, ClosingStatistics, Event, Fault, LandmarkRefit, SlamConfig, Stage, StageObserver,
    Unobserved,
};
use geometry::{GaussianPose2, Pose2};
use manifold::{Change, Manifold, PatchId};
use matching::CompactPoints;
use sensing::Observation;

/// One map from a stream of observations.
///
/// Deterministic: the same observations and configuration give the same map, on any number of
/// threads.
pub struct Mapper {
    config: SlamConfig,
    preparation: Preparation,
    front_end: FrontEnd,
    closer: LoopCloser,
    landmarks: LandmarkCloser,
    integrity: Integrity,
    pub(crate) map: Map,
    pub(crate) scans: Vec<ScanRecord>,
    statistics: Statistics,
    observer: Box<dyn StageObserver>,
}

impl Mapper {
    /// An empty map.
    pub fn new(config: SlamConfig) -> Self {
        Self::observed(config, Box::new(Unobserved))
    }

    /// An empty map whose stages are reported to `observer`.
    pub fn observed(config: SlamConfig, observer: Box<dyn StageObserver>) -> Self {
        Mapper {
            config,
            preparation: Preparation::new(&config),
            front_end: FrontEnd::new(config),
            closer: LoopCloser::new(&config),
            landmarks: LandmarkCloser::new(&config),
            integrity: Integrity::new(config.integrity),
            map: Map::default(),
            scans: Vec::new(),
            statistics: Statistics::default(),
            observer,
        }
    }

    /// Takes one observation: localises the robot, extends the map, closes loops.
    pub fn step(&mut self, observation: Observation) -> Vec<Event> {
        let prepared = self.timed(Stage::Lines, |m| m.preparation.prepare(observation));
        self.step_prepared(prepared)
    }

    /// [`Mapper::step`] for an observation prepared elsewhere, on another thread for example.
    pub fn step_prepared(&mut self, prepared: PreparedObservation) -> Vec<Event> {
        let PreparedObservation { mut observation, mut surface } = prepared;
        observation.odom_from_base = self.config.usable_odometry(observation.odom_from_base);
        self.front_end.level_odometry(&mut observation);
        self.watch_sensors(&observation);
        let stance = self.front_end.level(&mut observation, &mut surface);
        let odom_from_base = observation.odom_from_base;
        let (stamp, sightings) = (observation.stamp, std::mem::take(&mut observation.sightings));
        let witness = self.integrity.witness(&observation);
        let found = self.timed(Stage::Localisation, |m| match stance {
            Stance::Upright => m.front_end.process(observation, &surface, &mut m.map),
            Stance::Tipped => m.front_end.follow(observation, &surface, &mut m.map),
        });
        self.count(&found);
        let noted = self.map.manifold.sightings().len();
        note_sightings(&mut self.map, &found, stamp, &sightings);
        let pose = ScanPose { patch: found.patch, patch_from_base: found.patch_from_base };
        let surface = CompactPoints::new(&surface);
        let left_out = self.integrity.is_bad();
        self.scans.push(ScanRecord { found: pose, pose, stamp, odom_from_base, left_out, surface });
        if left_out {
            self.leave_out(&found);
        } else if self.watch_fit(witness, &found) && found.is_patch {
            self.close_loops(found.patch);
        }
        self.close_by_landmarks(noted);
        let mut events = vec![Event::Localised(self.scans.len() - 1, pose)];
        events.extend(self.map.manifold.take_journal().into_iter().map(Event::Map));
        events
    }

    /// Closes the loops that only show once everything was observed: the map is known better now
    /// than when each patch was new.
    pub fn conclude(&mut self) {
        self.integrity.pieces.set_aside(&mut self.map, &mut self.scans);
        self.optimise();
        forget_ground(&mut self.map, &self.config.elevation);
        self.look_again();
        self.closer.finish();
        // As the map is now: what it derives must follow from what is kept of it.
        forget_ground(&mut self.map, &self.config.elevation);
    }

    /// The global pass over everything observed. More observations may follow, and another pass.
    pub fn finish(&mut self) -> Vec<Event> {
        self.conclude();
        let config = self.config;
        let mut memory = Memory::default();
        let measured = self.timed(Stage::Refit, |m| refit(&mut m.map, &config, &mut memory));
        self.statistics.overlaps += measured;
        self.timed(Stage::Relocalisation, |m| {
            relocalise(&m.map, &mut [&mut m.scans[..]], &config, &mut memory);
        });
        if let Some(last) = self.map.manifold.patches().last().map(|p| p.id) {
            self.front_end.relocate(&self.map, last);
        }
        let localised = self.scans.iter().enumerate().map(|(i, s)| Event::Localised(i, s.pose));
        let mut events: Vec<Event> = localised.collect();
        events.extend(self.map.manifold.take_journal().into_iter().map(Event::Map));
        events
    }

    /// What happened to the map since it was last told, by an event or here.
    pub fn take_changes(&mut self) -> Vec<Change> {
        self.map.manifold.take_journal()
    }

    /// The map.
    pub fn manifold(&self) -> &Manifold {
        &self.map.manifold
    }

    /// Base pose of every scan in the map's frame, in the order of the observations.
    pub fn trajectory(&self) -> Vec<Pose2> {
        self.scans.iter().map(|s| s.pose.in_map(&self.map.manifold)).collect()
    }

    /// Counts so far.
    pub fn statistics(&self) -> Statistics {
        let mut statistics = self.statistics;
        let retracted = statistics.closures.retracted;
        statistics.closures = ClosingStatistics { retracted, ..self.closer.statistics };
        statistics
    }

    /// Stretches of the log that are left out of the map, in the order of the observations.
    pub fn bad_stretches(&self) -> Vec<BadStretch> {
        self.integrity.pieces.bad_stretches(self.scans.len())
    }

    /// Looks for loops that end at a new patch; re-estimates the map when one moves it.
    fn close_loops(&mut self, patch: PatchId) {
        let closures = self.timed(Stage::LoopClosing, |m| m.closer.search(patch, &m.map));
        if relate(&mut self.map, &closures, &self.config) {
            self.optimise();
            self.front_end.relocate(&self.map, patch);
        }
    }

    /// Looks for loops that the landmarks just noted close, those from `first` on.
    fn close_by_landmarks(&mut self, first: usize) {
        if self.map.manifold.sightings().len() == first {
            return;
        }
        let links = self.timed(Stage::LoopClosing, |m| m.landmarks.search(first, &m.map));
        for link in &links {
            self.map.manifold.relate(link.from, link.to, link.from_from_to, link.provenance);
        }
        self.closer.statistics.tried += links.len();
        self.closer.statistics.accepted += links.len();
        let at_once = self.config.merging.landmarks.refit == LandmarkRefit::Continuous;
        if let Some(link) = links.first().filter(|_| at_once) {
            self.optimise();
            self.front_end.relocate(&self.map, link.to);
        }
    }

    /// Searches once more from every patch: the map is known better now than when each was new, and
    /// what was too vague to find then may be near at hand.
    fn look_again(&mut self) {
        let patches = self.map.manifold.patches().iter().filter(|p| !p.left_out);
        let patches: Vec<PatchId> = patches.map(|p| p.id).collect();
        let closures = self.timed(Stage::LoopClosing, |m| m.closer.search_all(&patches, &m.map));
        if !closures.is_empty() {
            relate(&mut self.map, &closures, &self.config);
            self.optimise();
        }
    }

    fn optimise(&mut self) {
        estimate_elevations(&mut self.map);
        let retracted =
            self.timed(Stage::Optimisation, |m| optimise_relations(&mut m.map, &m.config));
        self.statistics.optimisations += 1;
        self.statistics.closures.retracted += retracted.len();
    }

    /// Cuts the map where the sensors say that data went bad; goes on where they are good again.
    fn watch_sensors(&mut self, observation: &Observation) {
        let number = self.scans.len();
        let Mapper { integrity, map, scans, .. } = self;
        integrity.pieces.take_up(map, scans);
        integrity.pieces.begin_scan(map);
        match integrity.sensors.watch(observation) {
            Verdict::Unchanged => {}
            Verdict::WentBad(fault, bad) => {
                self.cut(fault, number + 1 - bad);
                // What is left out is told where odometry has it.
                self.restart(self.believed(observation));
            }
            Verdict::GoodAgain => self.resume(observation),
        }
    }

    /// Cuts the map where scans no longer fit it; true as long as they do.
    fn watch_fit(&mut self, scan: Option<WitnessScan>, found: &Localisation) -> bool {
        let Some(bad) = self.integrity.judge(scan, found, &self.map) else { return true };
        let next = self.scans.len();
        self.cut(Fault::Lost, next - bad);
        self.integrity.pieces.resume(next, false);
        false
    }

    /// Leaves out everything since a scan; what follows is another island.
    fn cut(&mut self, fault: Fault, from: usize) {
        self.integrity.pieces.cut(fault, from, &mut self.map, &mut self.scans);
        self.restart(Pose2::IDENTITY);
        self.optimise();
    }

    /// Data are good again. Where odometry bridges the time between, the map goes on from there.
    fn resume(&mut self, observation: &Observation) {
        let bridge = self.integrity.pieces.blind_since().and_then(|from| {
            let last = self.scans.get(from.checked_sub(1)?).filter(|scan| !scan.left_out)?.found;
            let moved = bridge(&self.scans[from - 1..], observation, &self.config.odometry)?;
            Some((last.patch, GaussianPose2 { mean: last.patch_from_base * moved.mean, ..moved }))
        });
        self.integrity.pieces.resume(self.scans.len(), bridge.is_some());
        self.restart(
            bridge.map_or(Pose2::IDENTITY, |(from, step)| self.map.pose(from) * step.mean),
        );
        if let Some((from, relation)) = bridge {
            self.front_end.bridge(from, relation);
        }
    }

    /// Where odometry has the robot after the scans so far.
    fn believed(&self, observation: &Observation) -> Pose2 {
        let Some(last) = self.scans.last() else { return Pose2::IDENTITY };
        let moved = bridge(std::slice::from_ref(last), observation, &self.config.odometry);
        last.found.in_map(&self.map.manifold) * moved.map_or(Pose2::IDENTITY, |m| m.mean)
    }

    fn restart(&mut self, island_from_base: Pose2) {
        self.front_end.restart(island_from_base);
        self.integrity.restart();
        self.closer.finish();
    }

    fn leave_out(&mut self, found: &Localisation) {
        if found.is_patch {
            self.map.manifold.leave_out(vec![found.patch], true);
        }
    }

    fn count(&mut self, found: &Localisation) {
        self.statistics.scans += 1;
        self.statistics.patches += usize::from(found.is_patch);
        self.statistics.recoveries += usize::from(found.recovered);
        self.statistics.tipped += usize::from(found.tipped);
        self.statistics.poor_fits += usize::from(found.explained < 0.5);
    }

    fn timed<T>(&mut self, stage: Stage, work: impl FnOnce(&mut Self) -> T) -> T {
        self.observer.begin(stage);
        let result = work(self);
        self.observer.end(stage);
        result
    }
}
