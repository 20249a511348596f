use crate::map::Map;
use crate::merging::{join, propose_by_landmarks};
use crate::refit::{optimise_relations, refit, relocalise};
use crate::track::{ScanPose, ScanRecord};
use crate::{Mapper, SlamConfig, Stage, StageObserver, Statistics, Unobserved};
use geometry::Pose2;
use manifold::{Change, Manifold, PatchId, RelationId, Way};
use sensing::RobotId;

/// The map of a team: every robot's own map, islands until evidence joins them.
///
/// Robots map by themselves ([`Mapper`]); what they found is joined here. The result depends on the
/// robots and the order in which they join, and on nothing else.
pub struct Team {
    config: SlamConfig,
    map: Map,
    tracks: Vec<Track>,
    statistics: Statistics,
    observer: Box<dyn StageObserver>,
}

/// What is known of one robot.
#[derive(Clone, Debug, Default)]
struct Track {
    scans: Vec<ScanRecord>,
    statistics: Statistics,
    /// Names in the team's map of what the robot calls by its own.
    patches: Vec<PatchId>,
    relations: Vec<RelationId>,
}

impl Team {
    /// A team without robots.
    pub fn new(config: SlamConfig) -> Self {
        Self::observed(config, Box::new(Unobserved))
    }

    /// A team whose stages are reported to `observer`.
    pub fn observed(config: SlamConfig, observer: Box<dyn StageObserver>) -> Self {
        let (map, statistics) = (Map::default(), Statistics::default());
        Team { config, map, tracks: Vec::new(), statistics, observer }
    }

    /// Takes a robot into the team; its changes may follow.
    pub fn add_robot(&mut self, name: &str) -> RobotId {
        self.tracks.push(Track::default());
        self.map.manifold.add_robot(name)
    }

    /// Repeats in the team's map what happened in a robot's own.
    pub fn receive(&mut self, robot: RobotId, changes: &[Change]) {
        for change in changes {
            self.repeat(robot, change);
        }
    }

    /// Takes over everything a robot mapped, the changes not yet received included.
    pub fn join(&mut self, robot: RobotId, mut mapper: Mapper) {
        let changes = mapper.take_changes();
        self.receive(robot, &changes);
        let statistics = mapper.statistics();
        let track = &mut self.tracks[usize::from(robot.0)];
        for (patch, surface) in track.patches.iter().zip(mapper.map.surfaces) {
            self.map.set_surface(*patch, surface);
        }
        track.scans = mapper.scans;
        for scan in &mut track.scans {
            scan.pose.patch = track.patches[scan.pose.patch.index()];
        }
        track.statistics = statistics;
    }

    /// The global pass: joins islands, refits each and places every scan in it.
    pub fn finish(&mut self) {
        self.merge();
        let config = self.config;
        let measured = self.timed(Stage::Refit, |t| refit(&mut t.map, &config));
        self.statistics.overlaps += measured;
        self.timed(Stage::Relocalisation, |t| {
            let mut tracks: Vec<&mut [ScanRecord]> =
                t.tracks.iter_mut().map(|track| &mut track.scans[..]).collect();
            relocalise(&t.map, &mut tracks, &config);
        });
    }

    /// The map.
    pub fn manifold(&self) -> &Manifold {
        &self.map.manifold
    }

    /// What happened to the map since this was last asked.
    pub fn take_changes(&mut self) -> Vec<Change> {
        self.map.manifold.take_journal()
    }

    /// Where each of a robot's scans was taken, in the order of its observations.
    pub fn scan_poses(&self, robot: RobotId) -> impl ExactSizeIterator<Item = ScanPose> + '_ {
        self.tracks[usize::from(robot.0)].scans.iter().map(|scan| scan.pose)
    }

    /// Base pose of each of a robot's scans in the frame of the island it is on.
    pub fn trajectory(&self, robot: RobotId) -> Vec<Pose2> {
        self.scan_poses(robot).map(|pose| pose.in_map(&self.map.manifold)).collect()
    }

    /// Counts of one robot's own mapping.
    pub fn robot_statistics(&self, robot: RobotId) -> Statistics {
        self.tracks[usize::from(robot.0)].statistics
    }

    /// Counts so far: all robots' and the team's own.
    pub fn statistics(&self) -> Statistics {
        self.tracks.iter().fold(self.statistics, |sum, track| sum + track.statistics)
    }

    /// Joins islands where evidence says how they lie to each other, the surest first.
    fn merge(&mut self) {
        if !self.config.merging.enabled || self.map.manifold.component_map().members.len() < 2 {
            return;
        }
        loop {
            let islands = self.map.manifold.component_map();
            let tracks: Vec<&[ScanRecord]> = self.tracks.iter().map(|t| &t.scans[..]).collect();
            let proposals = propose_by_landmarks(&self.map, &islands, &tracks, &self.config);
            let sure = proposals.iter().filter(|p| p.is_sure(&self.config.merging));
            let Some(surest) = sure.min_by(|a, b| a.false_bound.total_cmp(&b.false_bound)) else {
                for link in proposals.iter().flat_map(|p| &p.links) {
                    let (from, to) = (link.from, link.to);
                    self.map.manifold.propose(from, to, link.from_from_to, link.provenance);
                }
                return;
            };
            join(&mut self.map, &islands, surest);
            self.optimise();
        }
    }

    fn optimise(&mut self) {
        let config = self.config;
        let retracted =
            self.timed(Stage::Optimisation, |t| optimise_relations(&mut t.map, &config));
        self.statistics.optimisations += 1;
        self.statistics.closures.retracted += retracted.len();
    }

    fn repeat(&mut self, robot: RobotId, change: &Change) {
        let manifold = &mut self.map.manifold;
        let track = &mut self.tracks[usize::from(robot.0)];
        let patch = |own: &PatchId| track.patches[own.index()];
        match change {
            Change::RobotJoined(_) => {}
            Change::PatchAdded(own) => {
                let mut added = own.clone();
                added.robot = robot;
                track.patches.push(manifold.add_patch(added));
            }
            Change::RelationAdded(own) => {
                let (from, to) = (patch(&own.from), patch(&own.to));
                let id = manifold.relate(from, to, own.from_from_to, own.provenance);
                track.relations.push(id);
            }
            Change::RelationConfirmed(own) => manifold.confirm(track.relations[own.index()]),
            Change::RelationRetracted(own, reason) => {
                manifold.retract(track.relations[own.index()], *reason);
            }
            Change::PosesReestimated(poses) => {
                manifold.refit(poses.iter().map(|(own, pose)| (patch(own), *pose)).collect());
            }
            Change::ElevationsReestimated(heights) => {
                manifold.elevate(heights.iter().map(|(own, h)| (patch(own), *h)).collect());
            }
            Change::WayNoted(own) => {
                let (from, to) = (patch(&own.from), patch(&own.to));
                manifold.note_way(Way { from, to, ..*own });
            }
            Change::LandmarkSighted(own) => {
                let mut sighting = own.clone();
                sighting.patch = patch(&own.patch);
                manifold.note_sighting(sighting);
            }
            Change::LeftOut(patches, left_out) => {
                manifold.leave_out(patches.iter().map(patch).collect(), *left_out);
            }
        }
    }

    fn timed<T>(&mut self, stage: Stage, work: impl FnOnce(&mut Self) -> T) -> T {
        self.observer.begin(stage);
        let result = work(self);
        self.observer.end(stage);
        result
    }
}
