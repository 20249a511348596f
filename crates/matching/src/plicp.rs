use crate::closest::{
    ClosestPair, ClosestPoints, ClosestSettings, NearestPoint, PairWeight, RangeErrors,
};
use crate::{MatchResult, Matcher, PointCloud, Prior};
use geometry::Matrix2;

/// PL-ICP: distances count across the reference's line alone (Censi, "An ICP variant using a
/// point-to-line metric", ICRA 2008), with Censi's covariance (ICRA 2007).
///
/// The line is the one fitted around the closest reference point, not that through the two closest
/// points: the reference may be a submap of many scans, where the second closest belongs to another
/// scan and their line is all noise. The paper's outlier rules: a tenth trimmed, then pairs dropped
/// whose error is more than twice that of the 70 % quantile.
#[derive(Clone, Copy, Debug)]
pub struct PlIcpMatcher {
    /// The settings.
    pub settings: ClosestSettings,
}

impl Default for PlIcpMatcher {
    fn default() -> Self {
        let settings = ClosestSettings {
            keep: 0.95,
            adaptive_factor: 2.0,
            normal_cos: 0.7,
            ..ClosestSettings::default()
        };
        PlIcpMatcher { settings }
    }
}

struct AcrossTheLine;

impl PairWeight for AcrossTheLine {
    fn of(&self, pair: &ClosestPair, _: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        let normal = pair.reference.normal?;
        Some(normal * normal.transpose())
    }
}

impl Matcher for PlIcpMatcher {
    fn name(&self) -> &'static str {
        "plicp"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let errors = RangeErrors { range_std_m: self.settings.range_std_m };
        let correspondence = &NearestPoint::of(reference);
        let settings = &self.settings;
        ClosestPoints {
            settings,
            correspondence,
            weight: &AcrossTheLine,
            scan,
            locked_turn_rad: 0.0,
        }
        .align(prior, |here, pose| errors.covariance(here, pose))
    }
}
