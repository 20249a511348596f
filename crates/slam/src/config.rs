use crate::{ClosingSettings, RefitSettings};
use manifold::SubmapLimits;
use matching::{BeamNoise, FastSettings, FieldSettings, LineFitSettings};
use serde::{Deserialize, Serialize};

/// Everything that can be set about the pipeline. The defaults are meant for every building.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SlamConfig {
    /// How far odometry is trusted.
    pub odometry: OdometrySettings,
    /// When a scan becomes a patch.
    pub extension: ExtensionSettings,
    /// What belongs to a local submap.
    pub submap: SubmapLimits,
    /// The laser's measurement error.
    pub noise: BeamNoise,
    /// How surface lines are fitted to scans.
    pub lines: LineFitSettings,
    /// The surfel field of local submaps.
    pub field: FieldSettings,
    /// The fast matcher.
    pub matcher: FastSettings,
    /// Loop closing.
    pub closing: ClosingSettings,
    /// The global refit.
    pub refit: RefitSettings,
}

/// The motion model: standard deviations of the odometry's error between two scans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OdometrySettings {
    /// Use odometry where the log has it.
    pub enabled: bool,
    /// weight
    pub weight: f64,
    /// weight in refit
    pub refit_weight: f64,
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
            weight: 10.0,
            refit_weight: 1.0,
            translation_per_m: 0.1,
            translation_per_rad_m: 0.05,
            rotation_per_rad: 0.15,
            rotation_per_m_rad: 0.05,
            translation_floor_m: 0.01,
            rotation_floor_rad: 0.01,
        }
    }
}

/// When the manifold is extended: only when the fit says so (algorithm 5.2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ExtensionSettings {
    /// Largest 95 % interval of the position, metres.
    pub translation_m: f64,
    /// Largest 95 % interval of the yaw, radians.
    pub rotation_rad: f64,
    /// Smallest share of the scan that the submap must explain.
    pub explained: f64,
    /// A match that explains less than this of the scan is tried again from other starting points.
    pub recover_below: f64,
    /// Largest distance to the nearest patch, metres.
    pub distance_m: f64,
    /// Largest turn from the nearest patch, radians.
    pub turn_rad: f64,
}

impl Default for ExtensionSettings {
    fn default() -> Self {
        ExtensionSettings {
            translation_m: 0.05,
            rotation_rad: 0.02,
            explained: 0.7,
            recover_below: 0.45,
            distance_m: 0.6,
            turn_rad: 0.5,
        }
    }
}
