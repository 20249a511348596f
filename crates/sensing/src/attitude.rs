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

impl Attitude {
    /// The attitude without what the unit reads on level ground.
    pub fn without(&self, bias: &Attitude) -> Attitude {
        Attitude {
            roll_rad: self.roll_rad - bias.roll_rad,
            pitch_rad: self.pitch_rad - bias.pitch_rad,
        }
    }

    /// Angle between the base's z axis and the vertical, radians, 0 to pi.
    pub fn tilt_rad(&self) -> f64 {
        (self.roll_rad.cos() * self.pitch_rad.cos()).clamp(-1.0, 1.0).acos()
    }
}
