use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use serde::{Deserialize, Serialize};

/// The motion model: standard deviations of the odometry's error between two scans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OdometrySettings {
    /// Use odometry where the log has it.
    pub enabled: bool,
    /// Error of the translation per metre driven.
    pub translation_per_m: f64,
    /// Error of the translation per radian turned, metres.
    pub translation_per_rad_m: f64,
    /// Error of the rotation per radian turned.
    pub rotation_per_rad: f64,
    /// Error of the rotation per metre driven, radians.
    pub rotation_per_m_rad: f64,
    /// Error of the translation at a stand-still, metres.
    pub translation_floor_m: f64,
    /// Error of the rotation at a stand-still, radians.
    pub rotation_floor_rad: f64,
}

impl Default for OdometrySettings {
    fn default() -> Self {
        OdometrySettings {
            enabled: true,
            translation_per_m: 0.1,
            translation_per_rad_m: 0.05,
            rotation_per_rad: 0.15,
            rotation_per_m_rad: 0.05,
            translation_floor_m: 0.01,
            rotation_floor_rad: 0.01,
        }
    }
}

impl OdometrySettings {
    /// A measured motion with its covariance.
    pub fn gaussian(&self, motion: Pose2) -> GaussianPose2 {
        self.gaussian_along(motion, motion.norm(), motion.yaw.abs())
    }

    /// A measured motion whose path was longer than it looks: `distance_m` driven, `turn_rad`
    /// turned.
    pub fn gaussian_along(&self, motion: Pose2, distance_m: f64, turn_rad: f64) -> GaussianPose2 {
        let translation = self.translation_floor_m
            + self.translation_per_m * distance_m
            + self.translation_per_rad_m * turn_rad;
        let rotation = self.rotation_floor_rad
            + self.rotation_per_rad * turn_rad
            + self.rotation_per_m_rad * distance_m;
        let std = Vector3::new(translation, translation, rotation);
        let covariance = Matrix3::from_diagonal(&std.component_mul(&std));
        GaussianPose2 { mean: motion, covariance }
    }

    /// A guess that the robot moves on as before for another `secs`, with the doubt that goes with
    /// it: by then it may have braked, sped up or turned.
    pub fn guess(&self, last_motion: Pose2, secs: f64) -> GaussianPose2 {
        let translation = GUESS_M + GUESS_M_PER_SEC2 * secs * secs;
        let rotation = GUESS_RAD + GUESS_RAD_PER_SEC2 * secs * secs;
        let std = Vector3::new(translation, translation, rotation);
        let covariance = Matrix3::from_diagonal(&std.component_mul(&std));
        GaussianPose2 { mean: last_motion, covariance }
    }
}

/// How well a motion is guessed from the one before: metres, radians, and what accelerations add to
/// them. Of 0.5 to 4 m/s^2 and 3 to 8 rad/s^2 these did best over the stress logs without odometry.
const GUESS_M: f64 = 0.01;
const GUESS_RAD: f64 = 0.02;
const GUESS_M_PER_SEC2: f64 = 1.0;
const GUESS_RAD_PER_SEC2: f64 = 3.0;
