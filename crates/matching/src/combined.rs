use crate::{
    FastMatcher, FastSettings, FieldMatcher, FieldSettings, LikelihoodPyramid, LikelihoodSettings,
    LinePoint, MatchResult, MatchStatus, Matcher, PointCloud, Prior, SearchSettings, SearchWindow,
    SurfelField, WsmMatcher, WsmSettings,
};
use geometry::{Matrix3, Pose2, Vector2, Vector3, wrap_angle};
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
    /// About this many of the scan's points are searched with.
    pub search_points: usize,
    /// The table that is searched.
    pub likelihood: LikelihoodSettings,
    /// When this share of a scan's points lies on lines, the fast matcher refines; else WSM.
    pub lines: f64,
    /// The fast local matcher.
    pub fast: FastSettings,
    /// The field that it matches with.
    pub field: FieldSettings,
    /// The error model of points and the local matcher for trees, legs and other scattered points.
    pub scattered: WsmSettings,
    /// Another pose that explains a share of the scan smaller by less than this makes a match
    /// ambiguous.
    pub rival_margin: f64,
}

impl Default for CombinedSettings {
    fn default() -> Self {
        CombinedSettings {
            half_m: 1.0,
            half_yaw_rad: PI / 4.0,
            weak_m: 0.2,
            weak_rad: 0.15,
            min_score: 0.2,
            candidates: 5,
            search_points: 180,
            likelihood: LikelihoodSettings {
                cell_m: 0.1,
                sigma_m: 0.1,
                levels: 5,
                ..LikelihoodSettings::default()
            },
            // Two thirds of a wood lie on lines, all but a twentieth of a building.
            lines: 0.8,
            fast: FastSettings::default(),
            field: FieldSettings::default(),
            scattered: WsmSettings { gate_start_m: 0.4, ..WsmSettings::default() },
            rival_margin: 0.03,
        }
    }
}

/// A wide search where the guess is weak, then the fast local matcher: the way in which the
/// pipeline matches.
///
/// Branch and bound over a coarse table gives a few distinct grid poses; each is refined, and the
/// one that explains most of the scan wins. If another one, elsewhere, explains as much, the match
/// is [`MatchStatus::Ambiguous`]: a wide search that does not say so would be right by luck.
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
        let levels = window.map_or(0, |w| w.levels(self.settings.likelihood.cell_m));
        let prepared = self.prepare(reference, levels);
        match window {
            None => prepared.align(scan, prior),
            Some(window) => prepared.search(scan, &window, prior),
        }
    }
}

impl CombinedMatcher {
    /// Makes a reference ready for any number of matches: field and tables are built once.
    /// `levels` is that of the widest search to come, see [`SearchWindow::levels`].
    pub fn prepare<'a>(&self, reference: &'a PointCloud, levels: u8) -> CombinedReference<'a> {
        let settings = LikelihoodSettings { levels, ..self.settings.likelihood };
        CombinedReference {
            settings: self.settings,
            reference,
            pyramid: (levels > 0).then(|| LikelihoodPyramid::build(reference, &settings)),
            field: self.settings.local().field_of(reference),
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
        let (sin, cos) = prior.pose.yaw.sin_cos();
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
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

/// A reference made ready by [`CombinedMatcher::prepare`].
#[derive(Clone, Debug)]
pub struct CombinedReference<'a> {
    settings: CombinedSettings,
    reference: &'a PointCloud,
    pyramid: Option<LikelihoodPyramid>,
    field: Option<SurfelField>,
}

/// A scan with what of it lies on lines, if that is enough for the fast matcher.
struct PreparedScan<'a> {
    cloud: &'a PointCloud,
    lines: Option<Vec<LinePoint>>,
}

/// Answers nearer to each other than this are the same, metres and radians.
const SAME_M: f64 = 0.3;
const SAME_RAD: f64 = 0.2;
/// Grid poses of a search are at least this share of its window apart, and no more than
/// [`FARTHEST_APART_M`].
const APART: f64 = 0.3;
const FARTHEST_APART_M: f64 = 1.0;

impl CombinedReference<'_> {
    /// Matches a scan from a good guess.
    pub fn align(&self, scan: &PointCloud, prior: &Prior) -> MatchResult {
        self.refine(&self.prepare_scan(scan), &prior.pose, prior)
    }

    /// Searches a window for a scan, refines what was found and says whether another place fits as
    /// well.
    pub fn search(&self, scan: &PointCloud, window: &SearchWindow, prior: &Prior) -> MatchResult {
        let s = &self.settings;
        let scan = &*scan.in_order();
        let stride = scan.len().div_ceil(s.search_points.max(1)).max(1);
        let points: Vec<Vector2<f32>> =
            scan.points.iter().step_by(stride).map(|p| p.position.cast()).collect();
        let Some(pyramid) = self.pyramid.as_ref().filter(|_| points.len() >= MIN_POINTS) else {
            return MatchResult::failed(prior.pose, 0, MatchStatus::TooFewPoints);
        };
        let half_m = window.half_x_m.max(window.half_y_m);
        let settings = SearchSettings {
            min_score: s.min_score,
            candidates: s.candidates,
            separation_m: (APART * half_m).clamp(SAME_M, FARTHEST_APART_M),
            separation_rad: SAME_RAD,
            ..SearchSettings::default()
        };
        let found = pyramid.search_many(&points, window, &settings).candidates;
        let scan = self.prepare_scan(scan);
        let refined: Vec<MatchResult> =
            found.iter().map(|candidate| self.refine(&scan, &candidate.pose, prior)).collect();
        self.choose(&refined, prior)
    }

    fn prepare_scan<'b>(&self, cloud: &'b PointCloud) -> PreparedScan<'b> {
        let lines = self.settings.local().line_points(cloud);
        let enough = lines.len() as f64 >= self.settings.lines * cloud.len() as f64;
        PreparedScan { cloud, lines: (enough && self.field.is_some()).then_some(lines) }
    }

    /// The local matcher that suits the scan, from a starting point.
    fn refine(&self, scan: &PreparedScan<'_>, start: &Pose2, prior: &Prior) -> MatchResult {
        let s = &self.settings;
        if let (Some(field), Some(lines)) = (&self.field, &scan.lines) {
            return s.local().align_with(field, lines, &Prior { pose: *start, ..*prior });
        }
        let matcher = WsmMatcher { settings: s.scattered };
        matcher.align_from(self.reference, scan.cloud, start, prior)
    }

    /// The answer that explains most of the scan; ambiguous if one elsewhere explains as much.
    fn choose(&self, refined: &[MatchResult], prior: &Prior) -> MatchResult {
        let usable = || refined.iter().filter(|result| result.status.is_usable());
        let most = |best: Option<MatchResult>, next: &MatchResult| match best {
            Some(best) if best.inlier_ratio >= next.inlier_ratio => Some(best),
            _ => Some(*next),
        };
        let Some(best) = usable().fold(None, most) else {
            let status = MatchStatus::Diverged;
            return refined.first().copied().unwrap_or(MatchResult::failed(prior.pose, 0, status));
        };
        let rival = usable()
            .filter(|other| other.inlier_ratio > best.inlier_ratio - self.settings.rival_margin)
            .find(|other| !is_same(other, &best));
        match rival {
            Some(rival) => {
                MatchResult { status: MatchStatus::Ambiguous { rival: rival.pose }, ..best }
            }
            None => best,
        }
    }
}

/// Whether two answers are one: near each other, or apart along what the better one does not claim
/// to know.
fn is_same(other: &MatchResult, best: &MatchResult) -> bool {
    let apart = best.pose.between(&other.pose);
    let mut shift = apart.translation();
    if let MatchStatus::Degenerate { weak_axis } = best.status
        && let Some(axis) = weak_axis.xy().try_normalize(1e-9)
    {
        shift -= axis * axis.dot(&shift);
    }
    shift.norm() < SAME_M && wrap_angle(apart.yaw).abs() < SAME_RAD
}

/// Fewer points than this are not searched for.
const MIN_POINTS: usize = 4;
