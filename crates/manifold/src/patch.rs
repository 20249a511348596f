use geometry::Pose2;
use sensing::{Attitude, RobotId, Scan, Stamp, Sweep};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Name of a patch: its index in the manifold, in the order of creation.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
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
    /// Name; given by the manifold when the patch is added.
    pub id: PatchId,
    /// The robot that took the scan.
    pub robot: RobotId,
    /// When it was taken.
    pub stamp: Stamp,
    /// The scan; never changes. That of a leaning robot is the plan's: `sensing::Levelling`.
    pub scan: Arc<Scan>,
    /// How the robot moved while it was taken, where that is known.
    pub sweep: Option<Sweep>,
    /// Mounting of the laser when the scan was taken.
    pub base_from_laser: Pose2,
    /// How the base leaned when the scan was taken, where that is known.
    pub attitude: Option<Attitude>,
    /// Present estimate of the robot's base in the island's frame. Refits change this and the
    /// elevation, and nothing else.
    pub island_from_patch: Pose2,
    /// Present estimate of the height above the island's first patch; `None` where nothing tells.
    pub elevation: Option<Elevation>,
    /// Not to be drawn, matched or merged: its robot's data went bad.
    pub left_out: bool,
}

/// A height with its doubt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Elevation {
    /// Height above the island's first patch, metres.
    pub height_m: f64,
    /// Its variance, m^2.
    pub variance_m2: f64,
}

/// Places less apart in height than this may be one, metres: a robot does not fit between floors so
/// near each other.
const APART_M: f64 = 1.0;
/// Heights farther apart than so many standard deviations differ.
const APART_SIGMAS: f64 = 3.0;

impl Elevation {
    /// True when two places of an island certainly lie above each other, not beside each other.
    /// Their errors are taken as independent; those of the way they share count twice, which errs
    /// on the side of one place.
    pub fn is_apart_from(&self, other: &Elevation) -> bool {
        let std = (self.variance_m2 + other.variance_m2).max(0.0).sqrt();
        (self.height_m - other.height_m).abs() > APART_M.max(APART_SIGMAS * std)
    }
}
