use crate::{Attitude, Scan, Sighting, Stamp, Sweep};
use geometry::Pose2;
use serde::{Deserialize, Serialize};

/// Which robot an observation comes from: its index in the order the logs were given.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct RobotId(pub u16);

/// One scan and what the robot believed of its motion when it was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The robot that took the scan.
    pub robot: RobotId,
    /// When, by the log's clock. Never used for ordering.
    pub stamp: Stamp,
    /// Robot base in its odometry frame; `None` where the log has no odometry or it is switched
    /// off.
    pub odom_from_base: Option<Pose2>,
    /// Mounting of the laser on the robot.
    pub base_from_laser: Pose2,
    /// The scan.
    pub scan: Scan,
    /// How the robot moved while the scan was taken; `None` takes it as taken at once.
    pub sweep: Option<Sweep>,
    /// How the base leaned, where the log tells.
    pub attitude: Option<Attitude>,
    /// Landmarks seen since the scan before, as seen from where this scan was taken.
    pub sightings: Vec<Sighting>,
}
