use geometry::Pose2;
use manifold::{Manifold, PatchId};
use matching::CompactPoints;
use sensing::Stamp;

/// Where a scan was taken: a pose relative to a patch, so that it moves with the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanPose {
    /// The patch.
    pub patch: PatchId,
    /// The robot's base seen from the patch.
    pub patch_from_base: Pose2,
}

impl ScanPose {
    /// The pose in the frame of the patch's island.
    pub fn in_map(&self, manifold: &Manifold) -> Pose2 {
        manifold.patch(self.patch).island_from_patch * self.patch_from_base
    }
}

/// A scan of the log as the global pass needs it.
#[derive(Clone, Debug)]
pub(crate) struct ScanRecord {
    /// Where it was found when it was taken: what every global pass starts from.
    pub found: ScanPose,
    /// Where the last global pass has it.
    pub pose: ScanPose,
    pub stamp: Stamp,
    pub odom_from_base: Option<Pose2>,
    /// Its robot's data were bad: it is no part of the map.
    pub left_out: bool,
    pub surface: CompactPoints,
}
