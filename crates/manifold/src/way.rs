use crate::PatchId;
use geometry::GaussianPose2;

/// What a robot measured on its way from one of its patches to the next, beside the relation that
/// their scans gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    /// The earlier patch.
    pub from: PatchId,
    /// The later one.
    pub to: PatchId,
    /// `from_from_to` by odometry; `None` where odometry is missing or not believed.
    pub motion: Option<GaussianPose2>,
    /// The height gained; `None` without an inertial unit.
    pub climb: Option<Climb>,
}

/// Height gained on a way, by the inertial unit's pitch and the distance driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Climb {
    /// Sum of `-sin(pitch)` times the (signed) distance driven, metres; the unit's bias is in it.
    pub rise_m: f64,
    /// The signed distance driven, metres: a constant bias of the pitch adds in proportion to it.
    pub distance_m: f64,
    /// Variance of the rise from noise alone, m^2.
    pub variance_m2: f64,
}
