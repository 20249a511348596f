use crate::observations::{ObservationBlock, TakenScan};
use geometry::Pose2;
use manifold::{Change, Manifold, ManifoldError, PatchId};
use sensing::{RobotId, Stamp};
use std::collections::BTreeMap;

/// Everything a manifold file holds, as of its last step.
#[derive(Clone, Debug, Default)]
pub struct Site {
    /// The map. Its own journal is empty: the file has it.
    pub manifold: Manifold,
    /// The logs that robots recorded.
    pub logs: BTreeMap<RobotId, RobotLog>,
    /// For every robot its scans in the log's order.
    pub trajectories: Vec<Vec<TrackedScan>>,
    /// What of the scans is stored beside the trajectories, in the order it was written.
    pub observations: Vec<ObservationBlock>,
    /// Free entries: the program's version, the configuration, whether mapping was finished.
    pub metadata: BTreeMap<String, String>,
    /// What was written, step by step.
    pub steps: Vec<StepSummary>,
}

/// Which log a robot recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotLog {
    /// The robot.
    pub robot: RobotId,
    /// The log's name, without folders and endings.
    pub name: String,
    /// The file, as it was named.
    pub file: String,
    /// Hash of the file's content (see [`crate::ContentHash`]): the same log given again is known.
    pub content_hash: String,
    /// When the robot joined, nanoseconds since 1970, by the caller's clock.
    pub joined_unix_ns: i64,
    /// What the reader made of the log, JSON.
    pub reader_report: String,
}

/// One scan of a trajectory: where the robot was.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedScan {
    /// The stamp as the log has it, digit by digit.
    pub stamp_text: String,
    /// The stamp.
    pub stamp: Stamp,
    /// The patch that the pose is seen from; the scan moves with it.
    pub patch: PatchId,
    /// The robot's base in the frame of the patch.
    pub patch_from_base: Pose2,
    /// The robot's base in its odometry frame, where the log tells.
    pub odom_from_base: Option<Pose2>,
}

/// What happened between two moments at which the file is whole: written all at once or not at all.
#[derive(Clone, Debug, Default)]
pub struct Step {
    /// When, nanoseconds since 1970, by the caller's clock.
    pub time_unix_ns: i64,
    /// What for, in a few words: `scans`, `refit`, `user retracts 17`.
    pub note: String,
    /// Changes of the map, in order.
    pub changes: Vec<Change>,
    /// Logs of robots; a robot's log given again replaces what was known of it.
    pub logs: Vec<RobotLog>,
    /// Scans by robot and place in its log: the next place adds one, a place known before replaces
    /// what is there.
    pub scans: Vec<(RobotId, usize, TrackedScan)>,
    /// Scans as they were taken; their places in the trajectories are known then.
    pub observations: Vec<ObservationBlock>,
    /// Metadata to be set.
    pub metadata: Vec<(String, String)>,
}

impl Step {
    /// True when there is nothing to write.
    pub fn is_empty(&self) -> bool {
        self.changes.is_empty()
            && self.logs.is_empty()
            && self.scans.is_empty()
            && self.observations.is_empty()
            && self.metadata.is_empty()
    }
}

/// A step that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StepSummary {
    /// Its number, from 0.
    pub step: u64,
    /// When, nanoseconds since 1970.
    pub time_unix_ns: i64,
    /// What for.
    pub note: String,
    /// Number of its first change in the journal.
    pub first_change: u64,
    /// Changes in the journal.
    pub changes: u64,
    /// Scans added or replaced.
    pub scans: u64,
}

impl Site {
    /// Where every scan of a robot was taken, in the frame of its patch's island.
    pub fn poses(&self, robot: RobotId) -> impl Iterator<Item = Pose2> + '_ {
        let scans = self.trajectories.get(usize::from(robot.0)).into_iter().flatten();
        scans.map(|s| self.manifold.patch(s.patch).island_from_patch * s.patch_from_base)
    }

    /// The first patch of each patch's island: the island's name.
    pub fn island_names(&self) -> Vec<PatchId> {
        let islands = self.manifold.component_map();
        islands.of.iter().map(|island| islands.members[*island as usize][0]).collect()
    }

    /// Performs a step; the journal's and the step's own numbers are left to the caller.
    pub(crate) fn perform(&mut self, step: &Step) -> Result<(), ManifoldError> {
        let applied = step.changes.iter().try_for_each(|change| self.manifold.apply(change));
        self.manifold.take_journal();
        applied?;
        let robots = self.manifold.robots().len();
        self.trajectories.resize_with(robots, Vec::new);
        for log in &step.logs {
            if usize::from(log.robot.0) >= robots {
                return Err(ManifoldError::OutOfOrder);
            }
            self.logs.insert(log.robot, log.clone());
        }
        for (robot, index, scan) in &step.scans {
            self.track(*robot, *index, scan.clone()).ok_or(ManifoldError::OutOfOrder)?;
        }
        for block in &step.observations {
            self.observe(block.clone()).ok_or(ManifoldError::OutOfOrder)?;
        }
        self.metadata.extend(step.metadata.iter().cloned());
        Ok(())
    }

    /// Adds or replaces a scan; `None` when it does not follow.
    pub(crate) fn track(&mut self, robot: RobotId, index: usize, scan: TrackedScan) -> Option<()> {
        let known = scan.patch.index() < self.manifold.patches().len();
        let scans = self.trajectories.get_mut(usize::from(robot.0)).filter(|_| known)?;
        if index == scans.len() {
            scans.push(scan);
        } else {
            *scans.get_mut(index)? = scan;
        }
        Some(())
    }

    /// Adds a block; `None` when its robot has no such scans.
    pub(crate) fn observe(&mut self, block: ObservationBlock) -> Option<()> {
        let known = self.trajectories.get(usize::from(block.robot.0))?.len();
        let end = block.first_scan.checked_add(block.scans).filter(|end| *end <= known);
        end.map(|_| self.observations.push(block))
    }

    /// A robot's scans as they were taken, by place in its log: those that the file holds, with
    /// their patches' scans filled in.
    pub fn taken(&self, robot: RobotId) -> Vec<Option<TakenScan>> {
        let tracked = self.trajectories.get(usize::from(robot.0)).map_or(&[][..], Vec::as_slice);
        let mut all = vec![None; tracked.len()];
        for block in self.observations.iter().filter(|block| block.robot == robot) {
            let scans = block.unpack().unwrap_or_default();
            for (place, mut taken) in (block.first_scan..).zip(scans) {
                let Some(scan) = tracked.get(place) else { continue };
                taken.scan.get_or_insert_with(|| self.manifold.patch(scan.patch).scan.clone());
                all[place] = Some(taken);
            }
        }
        all
    }
}

/// The changes that build a manifold as it is, without its history.
pub fn changes_of(manifold: &Manifold) -> Vec<Change> {
    let robots = manifold.robots().iter().cloned().map(Change::RobotJoined);
    let patches = manifold.patches().iter().cloned().map(Change::PatchAdded);
    let relations = manifold.relations().iter().copied().map(Change::RelationAdded);
    let ways = manifold.ways().iter().copied().map(Change::WayNoted);
    let sightings = manifold.sightings().iter().cloned().map(Change::LandmarkSighted);
    robots.chain(patches).chain(relations).chain(ways).chain(sightings).collect()
}
