mod choice;
mod reference;
mod tables;

use crate::fast::turn;
use crate::{
    FastMatcher, FastSettings, FieldMatcher, FieldSettings, LikelihoodSettings, MatchResult,
    Matcher, PointCloud, Prior, SearchWindow, WsmSettings,
};
use geometry::Vector3;
pub use reference::CombinedReference;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Settings of [`CombinedMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CombinedSettings {
    /// Half the side of the square that is searched when nothing is known of the guess, metres.
    pub half_m: f64,
    /// Half the range of yaw that is searched then, radians.
    pub half_yaw_rad: f64,
    /// A guess is weak when three standard deviations of it are more than this, metres ...
    pub weak_m: f64,
    /// ... or this, radians: what the local matcher comes back from.
    pub weak_rad: f64,
    /// Grid poses that score less (0 to 1) are no candidates.
    pub min_score: f32,
    /// How many distinct grid poses are refined.
    pub candidates: usize,
    /// Grid poses that score less than the best by more than this are not refined.
    pub below_best: f32,
    /// About this many of the scan's points are searched with.
    pub search_points: usize,
    /// The table that is searched; its levels follow from the window.
    pub likelihood: LikelihoodSettings,
    /// When this share of a scan's points lies on surfaces of at least `wall_m`, the fast matcher
    /// refines; else WSM.
    pub walls: f64,
    /// Length of a surface that is no tree trunk and no leg, metres.
    pub wall_m: f64,
    /// The fast local matcher.
    pub fast: FastSettings,
    /// The field that it matches with.
    pub field: FieldSettings,
    /// The error model of points and the local matcher for trees, legs and other scattered points.
    pub scattered: WsmSettings,
    /// Another pose makes a match ambiguous if the share of the scan that it explains is smaller by
    /// less than this ...
    pub rival_explained: f64,
    /// ... and its inlier ratio by less than this.
    pub rival_inliers: f64,
}

impl Default for CombinedSettings {
    fn default() -> Self {
        CombinedSettings {
            half_m: 1.0,
            half_yaw_rad: PI / 4.0,
            weak_m: 0.2,
            weak_rad: 0.15,
            min_score: 0.2,
            candidates: 12,
            below_best: 0.1,
            search_points: 120,
            likelihood: LikelihoodSettings { cell_m: 0.1, sigma_m: 0.1, ..Default::default() },
            walls: 0.4,
            wall_m: 0.7,
            fast: FastSettings::default(),
            field: FieldSettings::default(),
            scattered: WsmSettings { gate_start_m: 0.4, ..WsmSettings::default() },
            rival_explained: 0.04,
            rival_inliers: 0.05,
        }
    }
}

/// A wide search where the guess is weak, then the fast local matcher: the way in which the
/// pipeline matches.
///
/// Branch and bound over a coarse table gives a few distinct grid poses; each is refined, and the
/// one that explains most of the scan wins. If another one, elsewhere, explains as much, the match
/// is [`Ambiguous`](crate::MatchStatus::Ambiguous): a wide search that does not say so would be
/// right by luck.
#[derive(Clone, Copy, Debug, Default)]
pub struct CombinedMatcher {
    /// The settings.
    pub settings: CombinedSettings,
}

impl Matcher for CombinedMatcher {
    fn name(&self) -> &'static str {
        "combined"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let window = self.settings.window(prior);
        let half_m = window.map_or(0.0, |w| w.half_x_m.max(w.half_y_m));
        let prepared = self.prepare(reference, half_m);
        match window {
            None => prepared.align(scan, prior),
            Some(window) => prepared.search(scan, &window, prior),
        }
    }
}

impl CombinedSettings {
    fn local(&self) -> FieldMatcher {
        let matcher = FastMatcher { settings: self.fast };
        FieldMatcher { matcher, field: self.field, error: self.scattered }
    }

    /// Where to look around a guess; `None` where the local matcher will find back by itself.
    fn window(&self, prior: &Prior) -> Option<SearchWindow> {
        let turn = turn(&prior.pose);
        let three_sigmas = prior
            .information
            .try_inverse()
            .map(|covariance| (turn * covariance * turn.transpose()).diagonal().map(|v| 9.0 * v))
            .filter(|v| v.iter().all(|v| v.is_finite() && *v > 0.0))
            .map_or(Vector3::repeat(f64::INFINITY), |v| v.map(f64::sqrt));
        let weak = three_sigmas.xy().max() > self.weak_m || three_sigmas.z > self.weak_rad;
        weak.then(|| SearchWindow {
            centre: prior.pose,
            half_x_m: three_sigmas.x.min(self.half_m),
            half_y_m: three_sigmas.y.min(self.half_m),
            half_yaw_rad: three_sigmas.z.min(self.half_yaw_rad),
        })
    }
}
