use geometry::{LieGroup, Pose2, Vector3};
use serde::{Deserialize, Serialize};

/// A robot's planar velocity in its own base frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Forward speed, metres a second.
    pub forward_m_per_sec: f64,
    /// Turning rate, counter-clockwise, radians a second.
    pub yaw_rad_per_sec: f64,
}

impl Twist {
    /// The motion in the base frame after `secs` of constant velocity: an arc.
    pub fn motion(&self, secs: f64) -> Pose2 {
        Pose2::exp(&Vector3::new(self.forward_m_per_sec * secs, 0.0, self.yaw_rad_per_sec * secs))
    }
}
