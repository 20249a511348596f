use crate::closest::{
    ClosestPair, ClosestPoints, ClosestSettings, NearestPoint, PairWeight, sliding_covariance,
};
use crate::{MatchResult, Matcher, PointCloud, Prior};
use geometry::Matrix2;

/// Plain point-to-point ICP (Besl and McKay, "A method for registration of 3-D shapes", 1992), the
/// baseline: closest points within a shrinking gate, the worst tenth of the pairs dropped.
///
/// For frozen pairs the Gauss-Newton step is the closed form `dphi = atan2(Sxy - Syx, Sxx + Syy)`
/// to second order, and both end in the same place; a prior takes part in it as well.
#[derive(Clone, Copy, Debug)]
pub struct IcpMatcher {
    /// The settings.
    pub settings: ClosestSettings,
}

impl Default for IcpMatcher {
    fn default() -> Self {
        // Pairs slide along walls with the pose: many short steps.
        let settings =
            ClosestSettings { max_iterations: 300, step_m: 1e-5, ..ClosestSettings::default() };
        IcpMatcher { settings }
    }
}

struct AllWaysAlike;

impl PairWeight for AllWaysAlike {
    fn of(&self, _: &ClosestPair, _: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        Some(Matrix2::identity())
    }
}

impl Matcher for IcpMatcher {
    fn name(&self) -> &'static str {
        "icp"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let correspondence = &NearestPoint::of(reference);
        let settings = &self.settings;
        // On a smooth surface each scan point may rest at the neighbour of its true partner.
        let locked_turn_rad = scan.points.first().map_or(0.0, |p| p.beam_step);
        let weight = &AllWaysAlike;
        ClosestPoints { settings, correspondence, weight, scan, locked_turn_rad }
            .align(prior, sliding_covariance)
    }
}
