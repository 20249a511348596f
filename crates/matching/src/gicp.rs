use crate::closest::{
    ClosestPair, ClosestPoints, ClosestSettings, NearestPoint, PairWeight, RangeErrors,
};
use crate::{CloudPoint, MatchResult, Matcher, PointCloud, Prior};
use geometry::Matrix2;
use serde::{Deserialize, Serialize};

/// Settings of [`GicpMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GicpSettings {
    /// What all matchers of closest points share.
    pub closest: ClosestSettings,
    /// Variance of a point across its surface, as a share of that along it.
    pub flatness: f64,
}

impl Default for GicpSettings {
    fn default() -> Self {
        let closest = ClosestSettings { normal_cos: 0.5, ..ClosestSettings::default() };
        GicpSettings { closest, flatness: 1e-3 }
    }
}

/// Generalised ICP in the plane (Segal, Haehnel, Thrun, "Generalized-ICP", RSS 2009): both points
/// of a pair are taken for samples of small pieces of wall, flat by `flatness`, and a pair weighs
/// `(C_a + R C_b R^T)^-1`.
#[derive(Clone, Copy, Debug, Default)]
pub struct GicpMatcher {
    /// The settings.
    pub settings: GicpSettings,
}

impl GicpMatcher {
    /// Covariance of a point by its surface; the same all ways where that is not known.
    pub(crate) fn shape(point: &CloudPoint, flatness: f64) -> Matrix2<f64> {
        match point.normal {
            Some(n) => Matrix2::identity() - n * n.transpose() * (1.0 - flatness),
            None => Matrix2::identity(),
        }
    }
}

struct PlaneToPlane {
    flatness: f64,
}

impl PairWeight for PlaneToPlane {
    fn of(&self, pair: &ClosestPair, rotation: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        let [reference, scan] =
            [&pair.reference, &pair.scan].map(|point| GicpMatcher::shape(point, self.flatness));
        (reference + rotation * scan * rotation.transpose()).try_inverse()
    }
}

impl Matcher for GicpMatcher {
    fn name(&self) -> &'static str {
        "gicp"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let GicpSettings { closest, flatness } = &self.settings;
        let weight = PlaneToPlane { flatness: *flatness };
        let errors = RangeErrors { range_std_m: closest.range_std_m };
        let correspondence = &NearestPoint::of(reference);
        ClosestPoints {
            settings: closest,
            correspondence,
            weight: &weight,
            scan,
            locked_turn_rad: 0.0,
        }
        .align(prior, |here, pose| errors.covariance(here, pose))
    }
}
