use geometry::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What a landmark is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LandmarkKind {
    /// A person to be found.
    Victim,
    /// A tag that answers with its id.
    Tag,
    /// Another robot of the team; its id is that robot's name. It moves: two sightings of it are
    /// the same place only at the same time.
    Robot,
}

/// A landmark seen from a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    /// What it is.
    pub kind: LandmarkKind,
    /// Which one it is, where the sensor tells.
    pub id: Option<Arc<str>>,
    /// Where it is seen, in the frame of the robot's base (of the patch, once stored there),
    /// metres.
    pub position: Vector2<f64>,
    /// Covariance of the position in the same frame, m^2.
    pub covariance: Matrix2<f64>,
    /// Heading of another robot in the same frame, radians, with its variance, where it is seen.
    pub yaw: Option<(f64, f64)>,
}
