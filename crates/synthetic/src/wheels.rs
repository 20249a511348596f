use crate::standard_normal;
use geometry::{LieGroup, Pose2, Vector3};
use rand::Rng;

/// What wheel odometry gets wrong: a random walk and a systematic share.
///
/// The random part's *variance* grows in proportion to the way, so that it does not depend on how
/// finely the way is cut (unlike the usual alpha model, whose standard deviation does).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelNoise {
    /// Yaw error after a metre driven, rad/sqrt(m).
    pub yaw_per_metre: f64,
    /// Yaw error after a radian turned, rad/sqrt(rad).
    pub yaw_per_radian: f64,
    /// Error along and across the way after a metre driven, m/sqrt(m).
    pub translation_per_metre: f64,
    /// Error of translation after a radian turned, m/sqrt(rad).
    pub translation_per_radian: f64,
    /// Systematic yaw drift, rad/m (unequal wheels).
    pub yaw_drift: f64,
    /// Systematic share by which distances are over-reported.
    pub distance_scale: f64,
    /// Systematic share by which rotations are over-reported (wrong wheel base).
    pub yaw_scale: f64,
}

impl WheelNoise {
    /// Perfect wheels.
    pub const NONE: WheelNoise = WheelNoise {
        yaw_per_metre: 0.0,
        yaw_per_radian: 0.0,
        translation_per_metre: 0.0,
        translation_per_radian: 0.0,
        yaw_drift: 0.0,
        distance_scale: 0.0,
        yaw_scale: 0.0,
    };

    /// Badly drifting wheels, as in the Intel log: metres and tens of degrees after a loop.
    pub fn poor() -> Self {
        WheelNoise { yaw_per_metre: 0.02, yaw_drift: 0.004, yaw_scale: 0.03, ..Self::default() }
    }

    /// The odometry's account of one true step, `previous_from_next`.
    pub fn measure(&self, step: &Pose2, rng: &mut impl Rng) -> Pose2 {
        let v = step.log();
        let (way, turn) = (v.x.hypot(v.y), v.z.abs());
        let walk = |per_metre: f64, per_radian: f64| {
            (per_metre * per_metre * way + per_radian * per_radian * turn).sqrt()
        };
        let translation = walk(self.translation_per_metre, self.translation_per_radian);
        let yaw = walk(self.yaw_per_metre, self.yaw_per_radian);
        let scale = 1.0 + self.distance_scale;
        Pose2::exp(&Vector3::new(
            v.x * scale + translation * standard_normal(rng),
            v.y * scale + 0.3 * translation * standard_normal(rng),
            v.z * (1.0 + self.yaw_scale) + self.yaw_drift * way + yaw * standard_normal(rng),
        ))
    }
}

impl Default for WheelNoise {
    /// An ordinary indoor robot: some degrees and decimetres after 20 m.
    fn default() -> Self {
        WheelNoise {
            yaw_per_metre: 0.01,
            yaw_per_radian: 0.015,
            translation_per_metre: 0.02,
            translation_per_radian: 0.01,
            yaw_drift: 0.001,
            distance_scale: 0.01,
            yaw_scale: 0.01,
        }
    }
}
