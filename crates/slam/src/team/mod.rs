mod resuming;

pub use resuming::{StoredScan, StoredTeam};

use crate::elevation::forget_ground;
use crate::loop_closing::{BetweenRobots, relate};
use crate::map::Map;
use crate::merging::{IslandLandmark, Merge, MergeState, Merger, places_of};
use crate::refit::{Memory, optimise_relations, reconsider_relations, refit, relocalise, settle};
use crate::track::{ScanPose, ScanRecord};
use crate::{BadStretch, Event, Mapper, SlamConfig, Stage, StageObserver, Statistics, Unobserved};
use geometry::Pose2;
use manifold::{Change, Manifold, PatchId, Relation, RelationId, RelationState, Retraction, Way};
use sensing::{Observation, RobotId};
use std::collections::{BTreeSet, VecDeque};

/// The map of a team: every robot's own map, islands until evidence joins them.
///
/// Robots map by themselves ([`Mapper`]); what they found is joined here. The result depends on the
/// robots and the order in which they join, and on nothing else.
pub struct Team {
    config: SlamConfig,
    map: Map,
    tracks: Vec<Track>,
    merges: Vec<Merge>,
    statistics: Statistics,
    observer: Box<dyn StageObserver>,
    /// What the last rebuild measured.
    memory: Memory,
}

/// Rounds of joining islands and closing the loops between their robots, after the first.
const MOST_ROUNDS: usize = 4;
/// Searches for closures between robots; hardly anything is left to be found by the last.
const MOST_SEARCHES: usize = 4;

/// What is known of one robot.
#[derive(Clone, Debug, Default)]
struct Track {
    scans: Vec<ScanRecord>,
    statistics: Statistics,
    /// What is left out of the map.
    bad: Vec<BadStretch>,
    /// Names in the team's map of what the robot calls by its own.
    patches: Vec<PatchId>,
    relations: Vec<RelationId>,
    /// What the team's map has of the robot already, where its log is mapped once more.
    known: Known,
}

/// What a robot's changes name that is in the map already, in the order of the changes.
#[derive(Clone, Debug, Default)]
struct Known {
    patches: VecDeque<PatchId>,
    relations: VecDeque<RelationId>,
    ways: usize,
    sightings: usize,
}

impl Team {
    /// A team without robots.
    pub fn new(config: SlamConfig) -> Self {
        Self::observed(config, Box::new(Unobserved))
    }

    /// A team whose stages are reported to `observer`.
    pub fn observed(config: SlamConfig, observer: Box<dyn StageObserver>) -> Self {
        Team {
            config,
            map: Map::default(),
            tracks: Vec::new(),
            merges: Vec::new(),
            statistics: Statistics::default(),
            observer,
            memory: Memory::default(),
        }
    }

    /// Takes a robot into the team; its changes may follow.
    pub fn add_robot(&mut self, name: &str) -> RobotId {
        self.tracks.push(Track::default());
        self.map.manifold.add_robot(name)
    }

    /// Takes a robot into the team with the map that it makes of its observations by itself.
    pub fn map_robot(
        &mut self,
        name: &str,
        observations: impl IntoIterator<Item = Observation>,
    ) -> RobotId {
        let robot = self.add_robot(name);
        let mut mapper = Mapper::new(self.config);
        for observation in observations {
            for event in mapper.step(observation) {
                if let Event::Map(change) = event {
                    self.repeat(robot, &change);
                }
            }
        }
        mapper.conclude();
        self.join(robot, mapper);
        robot
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
        let (statistics, bad) = (mapper.statistics(), mapper.bad_stretches());
        let track = &mut self.tracks[usize::from(robot.0)];
        for (patch, surface) in track.patches.iter().zip(mapper.map.surfaces) {
            self.map.set_surface(*patch, surface);
        }
        for (own, surface) in mapper.map.with_ground {
            self.map.with_ground.insert(track.patches[own.index()], surface);
        }
        for (patch, slope) in track.patches.iter().zip(mapper.map.slopes) {
            self.map.set_slope(*patch, slope);
        }
        track.scans = mapper.scans;
        for scan in &mut track.scans {
            scan.found.patch = track.patches[scan.found.patch.index()];
            scan.pose = scan.found;
        }
        (track.statistics, track.bad) = (statistics, bad);
        // Its patches may have been measured before they had all of their surfaces.
        self.memory = Memory::default();
    }

    /// Makes a proposed or retracted relation part of the map, by the user's word, and with it all
    /// of the merge that it belongs to; the map follows with [`Team::rebuild`].
    pub fn confirm(&mut self, relation: RelationId) {
        let merge = self.merges.iter().find(|merge| merge.relations.contains(&relation));
        let all = merge.map_or_else(|| vec![relation], |merge| merge.relations.clone());
        all.into_iter().for_each(|id| self.map.manifold.confirm(id));
    }

    /// Leaves a robot's patches out of the map, or takes them in again but for those of bad data;
    /// the map follows with [`Team::rebuild`].
    pub fn leave_out(&mut self, robot: RobotId, left_out: bool) {
        let scans = &self.tracks[usize::from(robot.0)].scans;
        let on = |is_bad: bool| -> BTreeSet<PatchId> {
            let scans = scans.iter().filter(|scan| scan.left_out == is_bad);
            scans.map(|scan| scan.found.patch).collect()
        };
        let (bad, good) = (on(true), on(false));
        let is_bad = |patch: PatchId| bad.contains(&patch) && !good.contains(&patch);
        let own =
            self.map.manifold.patches().iter().filter(|p| {
                p.robot == robot && p.left_out != left_out && (left_out || !is_bad(p.id))
            });
        let own = own.map(|p| p.id).collect();
        self.map.manifold.leave_out(own, left_out);
    }

    /// Takes a relation back, by the user's word. The map is that without it after
    /// [`Team::rebuild`].
    pub fn retract(&mut self, relation: RelationId) {
        self.map.manifold.retract(relation, Retraction::ByUser);
    }

    /// Takes back everything that relates a robot to others; returns what that was.
    pub fn split(&mut self, robot: RobotId) -> Vec<RelationId> {
        let owner = |patch: PatchId| self.map.manifold.patch(patch).robot;
        let across = |r: &&Relation| (owner(r.from) == robot) != (owner(r.to) == robot);
        let relations: Vec<RelationId> =
            self.map.manifold.active_relations().filter(across).map(|r| r.id).collect();
        relations.iter().for_each(|&id| self.retract(id));
        relations
    }

    /// A team of the same robots and patches with only the relations that `keep` accepts, which
    /// get new ids: what this team must equal once the others are taken back. Both are the same
    /// after [`Team::rebuild`].
    pub fn with_relations(&self, keep: impl Fn(&Relation) -> bool) -> Team {
        let mut team = Team::new(self.config);
        let manifold = &self.map.manifold;
        for robot in manifold.robots() {
            team.map.manifold.add_robot(&robot.name);
        }
        for patch in manifold.patches() {
            team.map.manifold.add_patch(patch.clone());
        }
        for r in manifold.relations().iter().filter(|r| keep(r)) {
            team.map.manifold.relate(r.from, r.to, r.from_from_to, r.provenance);
        }
        manifold.ways().iter().for_each(|way| team.map.manifold.note_way(*way));
        manifold.sightings().iter().for_each(|s| team.map.manifold.note_sighting(s.clone()));
        team.map.surfaces.clone_from(&self.map.surfaces);
        team.map.with_ground.clone_from(&self.map.with_ground);
        team.map.slopes.clone_from(&self.map.slopes);
        team.tracks.clone_from(&self.tracks);
        team
    }

    /// Brings the merges on record up to date with their relations.
    fn review_merges(&mut self) {
        let manifold = &self.map.manifold;
        let is =
            |ids: &[RelationId], state| ids.iter().any(|id| manifold.relation(*id).state == state);
        self.merges.retain_mut(|merge| {
            if is(&merge.relations, RelationState::Active) {
                merge.state = MergeState::Merged;
                return true;
            }
            merge.state = MergeState::Provisional;
            is(&merge.relations, RelationState::Provisional)
        });
    }

    /// The global pass: joins islands, closes loops between the robots of each, takes back what
    /// contradicts the rest, refits each and places every scan in it.
    pub fn finish(&mut self) {
        // Where robots met without knowing, their maps show the same ground twice, a little apart,
        // until the loops between them are closed, and others fit on neither.
        self.merge_by(Merger::begin);
        self.close_loops();
        let mut rounds = 0;
        while rounds < MOST_ROUNDS && self.merge() {
            self.close_loops();
            rounds += 1;
        }
        self.reconsider();
        self.rebuild();
    }

    /// Looks for places where robots of one island met without knowing: their maps hang together by
    /// where they were joined, and are bent against each other elsewhere. What is found makes the
    /// rest better known, so that the search is repeated while it finds something.
    pub fn close_loops(&mut self) {
        let config = self.config;
        let mut between = BetweenRobots::default();
        for _ in 0..MOST_SEARCHES {
            let (closures, statistics) =
                self.timed(Stage::LoopClosing, |t| between.search(&t.map, &config));
            self.statistics.closures = self.statistics.closures + statistics;
            if closures.is_empty() {
                break;
            }
            relate(&mut self.map, &closures, &config);
            let retracted =
                self.timed(Stage::Optimisation, |t| optimise_relations(&mut t.map, &config));
            self.statistics.optimisations += 1;
            self.statistics.closures.retracted += retracted.len();
        }
    }

    /// Takes back closures and merges, however early they were made, that by now contradict the
    /// rest.
    fn reconsider(&mut self) {
        let config = self.config;
        let contradicted =
            self.timed(Stage::Optimisation, |t| reconsider_relations(&mut t.map, &config));
        self.statistics.closures.retracted += contradicted.len();
    }

    /// Makes the map anew from the relations that hold, the ways driven and the scans: places every
    /// patch, refits each island, and places every scan. The result does not depend on what was
    /// part of the map before; what was measured then and would be measured again is taken over.
    pub fn rebuild(&mut self) {
        self.review_merges();
        let config = self.config;
        self.timed(Stage::Optimisation, |t| settle(&mut t.map, &config));
        forget_ground(&mut self.map, &config.elevation);
        let measured = self.timed(Stage::Refit, |t| refit(&mut t.map, &config, &mut t.memory));
        self.statistics.overlaps += measured;
        self.timed(Stage::Relocalisation, |t| {
            let mut tracks: Vec<&mut [ScanRecord]> =
                t.tracks.iter_mut().map(|track| &mut track.scans[..]).collect();
            relocalise(&t.map, &mut tracks, &config, &mut t.memory);
        });
        // As the map is now: what it derives must follow from what is kept of it.
        forget_ground(&mut self.map, &config.elevation);
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

    /// Stretches of a robot's log that are left out of the map, in the order of its observations.
    pub fn bad_stretches(&self, robot: RobotId) -> &[BadStretch] {
        &self.tracks[usize::from(robot.0)].bad
    }

    /// Islands that were merged, and merges that may be but are not sure enough.
    pub fn merges(&self) -> &[Merge] {
        &self.merges
    }

    /// The landmarks that stand still, island by island, where the map now has them. An id that was
    /// seen at several places, read wrong or moved, is there several times.
    pub fn landmarks(&self) -> Vec<IslandLandmark> {
        let manifold = &self.map.manifold;
        places_of(manifold, &manifold.component_map()).into_iter().flatten().collect()
    }

    /// Counts of one robot's own mapping.
    pub fn robot_statistics(&self, robot: RobotId) -> Statistics {
        self.tracks[usize::from(robot.0)].statistics
    }

    /// Counts so far: all robots' and the team's own.
    pub fn statistics(&self) -> Statistics {
        self.tracks.iter().fold(self.statistics, |sum, track| sum + track.statistics)
    }

    /// Joins islands where evidence says how they lie to each other; the poses are those of the
    /// relations until [`Team::rebuild`]. True if any were joined.
    pub fn merge(&mut self) -> bool {
        self.merge_by(Merger::run)
    }

    fn merge_by(&mut self, work: fn(&mut Merger, &mut Map, &[&[ScanRecord]], &SlamConfig)) -> bool {
        let islands = self.map.manifold.islands().len();
        if !self.config.merging.enabled || islands < 2 {
            return false;
        }
        let config = self.config;
        let merger = self.timed(Stage::Merging, |t| {
            let mut merger = Merger::default();
            let tracks: Vec<_> = t.tracks.iter().map(|track| &track.scans[..]).collect();
            work(&mut merger, &mut t.map, &tracks, &config);
            merger
        });
        // What may be merged was looked at anew.
        self.merges.retain(|merge| merge.state == MergeState::Merged);
        self.statistics.optimisations += merger.optimisations;
        self.statistics.closures.retracted += merger.contradicted;
        self.statistics.places_compared += merger.tried;
        self.merges.extend(merger.merges);
        self.map.manifold.islands().len() < islands
    }

    fn repeat(&mut self, robot: RobotId, change: &Change) {
        let manifold = &mut self.map.manifold;
        let track = &mut self.tracks[usize::from(robot.0)];
        let patch = |own: &PatchId| track.patches[own.index()];
        match change {
            Change::RobotJoined(_) => {}
            Change::PatchAdded(own) => {
                if let Some(id) = track.known.patches.pop_front() {
                    track.patches.push(id);
                    return;
                }
                let mut added = own.clone();
                added.robot = robot;
                track.patches.push(manifold.add_patch(added));
            }
            Change::RelationAdded(own) => {
                let (from, to) = (patch(&own.from), patch(&own.to));
                let id = match track.known.relations.pop_front() {
                    Some(id) => id,
                    None => manifold.relate(from, to, own.from_from_to, own.provenance),
                };
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
            Change::WayNoted(_) if track.known.ways > 0 => track.known.ways -= 1,
            Change::LandmarkSighted(_) if track.known.sightings > 0 => track.known.sightings -= 1,
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

#[cfg(test)]
mod taking_back;
