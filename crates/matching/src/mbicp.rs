use crate::closest::{ClosestPair, ClosestPoints, ClosestSettings, PairWeight, RangeErrors};
use crate::polyline::{Polyline, PolylineSettings};
use crate::{MatchResult, Matcher, PointCloud, Prior};
use geometry::Matrix2;
use serde::{Deserialize, Serialize};

/// Settings of [`MbIcpMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MbIcpSettings {
    /// What all matchers of closest points share; gates are distances of the metric.
    pub closest: ClosestSettings,
    /// What a radian counts for in the metric, metres: `L`. Infinity is Euclid's distance.
    pub length_m: f64,
    /// Neighbouring reference points nearer to each other than this are joined by a segment,
    /// metres.
    pub segment_m: f64,
    /// Reference points farther from a scan point than this are not looked at, metres.
    pub reach_m: f64,
}

impl Default for MbIcpSettings {
    fn default() -> Self {
        let closest = ClosestSettings { step_m: 1e-4, max_iterations: 200, ..Default::default() };
        MbIcpSettings { closest, length_m: 3.0, segment_m: 0.5, reach_m: 1.5 }
    }
}

/// Metric-based ICP (Minguez, Lamiraux, Montesano, "Metric-based scan matching algorithms for
/// mobile robot displacement estimation", ICRA 2005): the distance of two points is that of the
/// smallest motion, `x^2 + y^2 + L^2 theta^2`, that takes one to the other, so that far points may
/// be turned to their partners and not only shifted.
///
/// To first order that is `d^T M d` with `M = I - u u^T / (|p|^2 + L^2)`, `u = (p_y, -p_x)` for the
/// reference point `p` seen from where the scan is expected. (The thesis prints a plus; minimising
/// `|d - w J p|^2 + L^2 w^2` over `w` gives the minus.) The partner is the closest point on the
/// reference's polyline in this metric; the worst tenth of the pairs is dropped.
#[derive(Clone, Copy, Debug, Default)]
pub struct MbIcpMatcher {
    /// The settings.
    pub settings: MbIcpSettings,
}

impl PairWeight for Polyline<'_> {
    fn of(&self, pair: &ClosestPair, _: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        Some(self.metric(&pair.reference.position))
    }
}

impl Matcher for MbIcpMatcher {
    fn name(&self) -> &'static str {
        "mbicp"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let MbIcpSettings { length_m, segment_m, reach_m, .. } = self.settings;
        let settings = PolylineSettings { length_m, segment_m, reach_m };
        let polyline = Polyline::new(reference, prior.pose.translation(), settings);
        let settings = &self.settings.closest;
        let errors = RangeErrors { range_std_m: settings.range_std_m };
        ClosestPoints {
            settings,
            correspondence: &polyline,
            weight: &polyline,
            scan,
            locked_turn_rad: 0.0,
        }
        .align(prior, |here, pose| errors.covariance(here, pose))
    }
}
