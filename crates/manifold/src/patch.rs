use geometry::Pose2;
use sensing::{RobotId, Scan, Stamp};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Name of a patch: its index in the manifold, in the order of creation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct PatchId(pub u32);

impl PatchId {
    /// The id as an index.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A node of the manifold: a scan and its pose (a keyframe, elsewhere).
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Name.
    pub id: PatchId,
    /// The robot that took the scan.
    pub robot: RobotId,
    /// When it was taken.
    pub stamp: Stamp,
    /// The scan; never changes.
    pub scan: Arc<Scan>,
    /// Mounting of the laser when the scan was taken.
    pub base_from_laser: Pose2,
    /// Present estimate of the robot's base in the island's frame. The only thing refits change.
    pub island_from_patch: Pose2,
}
