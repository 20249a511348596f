use crate::{
    Candidate, LikelihoodPyramid, LikelihoodSettings, MatchResult, MatchStatus, PointCloud, Prior,
    SearchWindow, WsmMatcher, WsmSettings,
};
use geometry::Vector2;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Settings of the matchers that search a wide window before they refine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WideSettings {
    /// Half the side of the searched square around the prior, metres.
    pub half_m: f64,
    /// Half the range of yaw around the prior, radians.
    pub half_yaw_rad: f64,
    /// Poses that score less (0 to 1) are no candidates.
    pub min_score: f32,
    /// At most this many of the scan's points are searched with.
    pub max_points: usize,
    /// How many distinct candidates are refined (branch and bound only).
    pub candidates: usize,
    /// The tables.
    pub likelihood: LikelihoodSettings,
    /// The refinement.
    pub refine: WsmSettings,
}

impl Default for WideSettings {
    fn default() -> Self {
        WideSettings {
            half_m: 1.0,
            half_yaw_rad: PI / 4.0,
            min_score: 0.3,
            max_points: 200,
            candidates: 3,
            likelihood: LikelihoodSettings::default(),
            // A candidate is a cell and a step of yaw off: no need for a wide gate.
            refine: WsmSettings { gate_start_m: 0.3, ..WsmSettings::default() },
        }
    }
}

impl WideSettings {
    /// The window to search around a prior.
    pub(crate) fn window(&self, prior: &Prior) -> SearchWindow {
        SearchWindow {
            centre: prior.pose,
            half_x_m: self.half_m,
            half_y_m: self.half_m,
            half_yaw_rad: self.half_yaw_rad,
        }
    }

    /// Searches a window with `search`, refines what it found with the Weighted Scan Matcher, and
    /// returns the refined candidate that explains most of the scan.
    pub(crate) fn align(
        &self,
        reference: &PointCloud,
        scan: &PointCloud,
        prior: &Prior,
        search: impl Fn(&LikelihoodPyramid, &[Vector2<f32>], &SearchWindow) -> Vec<Candidate>,
    ) -> MatchResult {
        let (reference, scan) = (&*reference.in_order(), &*scan.in_order());
        let stride = scan.len().div_ceil(self.max_points.max(1)).max(1);
        let points: Vec<Vector2<f32>> = scan
            .points
            .iter()
            .map(|p| p.position.cast::<f32>())
            .filter(|p| p.x.is_finite() && p.y.is_finite())
            .step_by(stride)
            .collect();
        if points.len() < MIN_POINTS || reference.len() < MIN_POINTS {
            return MatchResult::failed(prior.pose, 0, MatchStatus::TooFewPoints);
        }
        let pyramid = LikelihoodPyramid::build(reference, &self.likelihood);
        let matcher = WsmMatcher { settings: self.refine };
        let mut best = MatchResult::failed(prior.pose, 0, MatchStatus::Diverged);
        for candidate in search(&pyramid, &points, &self.window(prior)) {
            let refined = matcher.align_from(reference, scan, &candidate.pose, prior);
            if refined.inlier_ratio > best.inlier_ratio {
                best = refined;
            }
        }
        best
    }
}

/// Fewer points than this are not searched for.
const MIN_POINTS: usize = 4;
