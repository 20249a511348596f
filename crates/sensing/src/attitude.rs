use serde::{Deserialize, Serialize};

/// How a robot's base leans, by its inertial unit. Axes are those of REP 103: x forward, y left, z
/// up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Attitude {
    /// Turn about the forward axis, radians; positive leans to the right.
    pub roll_rad: f64,
    /// Turn about the axis to the left, radians; positive points the nose down.
    pub pitch_rad: f64,
}
