use crate::{
    ClosingSettings, ElevationSettings, IntegritySettings, MergingSettings, OdometrySettings,
    RefitSettings,
};
use geometry::{LieGroup, Pose2};
use manifold::SubmapLimits;
use matching::{BeamNoise, FastSettings, FieldSettings, LineFitSettings, MatcherKind};
use serde::{Deserialize, Serialize};

/// Everything that can be set about the pipeline. The defaults are meant for every building.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SlamConfig {
    /// The matcher that localises scans in their local submap. Only `fast` keeps its reference from
    /// scan to scan; the others are for comparison, and far slower.
    pub front_end: MatcherKind,
    /// Residuals of neighbouring beams are not independent: the information a match claims is this
    /// many times what it has.
    pub match_correlation: f64,
    /// How far odometry is trusted.
    pub odometry: OdometrySettings,
    /// Heights, where robots have an inertial unit.
    pub elevation: ElevationSettings,
    /// When a scan becomes a patch.
    pub extension: ExtensionSettings,
    /// What belongs to a local submap.
    pub submap: SubmapLimits,
    /// Error of a relation that does not show in its match's residuals.
    pub relation_floor: RelationFloor,
    /// Loop closing.
    pub closing: ClosingSettings,
    /// Noticing bad data.
    pub integrity: IntegritySettings,
    /// Joining islands.
    pub merging: MergingSettings,
    /// The global refit.
    pub refit: RefitSettings,
    /// The laser's measurement error.
    pub noise: BeamNoise,
    /// How surface lines are fitted to scans.
    pub lines: LineFitSettings,
    /// The surfel field of local submaps.
    pub field: FieldSettings,
    /// The fast matcher.
    pub matcher: FastSettings,
}

impl Default for SlamConfig {
    fn default() -> Self {
        SlamConfig {
            front_end: MatcherKind::default(),
            match_correlation: 10.0,
            odometry: OdometrySettings::default(),
            elevation: ElevationSettings::default(),
            extension: ExtensionSettings::default(),
            submap: SubmapLimits::default(),
            relation_floor: RelationFloor::default(),
            closing: ClosingSettings::default(),
            integrity: IntegritySettings::default(),
            merging: MergingSettings::default(),
            refit: RefitSettings::default(),
            noise: BeamNoise::default(),
            lines: LineFitSettings::default(),
            field: FieldSettings::default(),
            matcher: FastSettings::default(),
        }
    }
}

/// Standard deviations below which no relation is trusted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RelationFloor {
    /// Along either axis, metres.
    pub translation_m: f64,
    /// Of the yaw, radians.
    pub rotation_rad: f64,
}

impl Default for RelationFloor {
    fn default() -> Self {
        RelationFloor { translation_m: 0.005, rotation_rad: 0.001 }
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
    /// What another start must explain more than the best so far, share of the scan.
    pub recover_gain: f64,
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
            recover_below: 0.5,
            recover_gain: 0.05,
            distance_m: 0.6,
            turn_rad: 0.5,
        }
    }
}

impl SlamConfig {
    /// Odometry that is used and can be a robot's: finite and on this planet. Anything else counts
    /// as missing.
    pub(crate) fn usable_odometry(&self, odom_from_base: Option<Pose2>) -> Option<Pose2> {
        let sane = |odom: &Pose2| odom.is_finite() && odom.norm() < LARGEST_ODOMETRY_M;
        odom_from_base.filter(|odom| self.odometry.enabled && sane(odom))
    }
}

/// The Earth's circumference, metres.
const LARGEST_ODOMETRY_M: f64 = 4e7;
