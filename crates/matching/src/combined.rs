use crate::{
    Candidate, FastMatcher, FastSettings, FieldMatcher, FieldSettings, LikelihoodPyramid,
    LikelihoodSettings, LinePoint, MatchResult, MatchStatus, Matcher, PointCloud, Prior,
    SearchSettings, SearchWindow, SurfelField, WsmMatcher, WsmSettings,
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
    /// Grid poses that score less than the best by more than this are not refined.
    pub below_best: f32,
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
        let half_m = window.map_or(0.0, |w| w.half_x_m.max(w.half_y_m));
        let prepared = self.prepare(reference, half_m);
        match window {
            None => prepared.align(scan, prior),
            Some(window) => prepared.search(scan, &window, prior),
        }
    }
}

impl CombinedMatcher {
    /// Makes a reference ready for any number of matches: field and tables are built once. Windows
    /// of up to `half_m` to each side will be searched, none if it is zero.
    pub fn prepare<'a>(&self, reference: &'a PointCloud, half_m: f64) -> CombinedReference<'a> {
        let s = &self.settings;
        CombinedReference {
            settings: self.settings,
            reference,
            tables: (half_m > 0.0).then(|| Tables::new(reference, half_m, &s.likelihood)),
            field: s.local().field_of(reference),
        }
    }
}

impl Tables {
    fn new(reference: &PointCloud, half_m: f64, settings: &LikelihoodSettings) -> Self {
        let factor = if half_m > WIDE_M { WIDE_FACTOR } else { 1.0 };
        let (cell_m, sigma_m) = (factor * settings.cell_m, factor * settings.sigma_m);
        let window = SearchWindow {
            centre: Pose2::IDENTITY,
            half_x_m: half_m,
            half_y_m: half_m,
            half_yaw_rad: PI,
        };
        let levels = window.levels(cell_m);
        let search = LikelihoodSettings { cell_m, sigma_m, levels, ..*settings };
        let near =
            LikelihoodSettings { cell_m: NEAR_CELL_M, sigma_m: NEAR_M, levels: 0, ..*settings };
        Tables {
            search: LikelihoodPyramid::build(reference, &search),
            near: LikelihoodPyramid::build(reference, &near),
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
    tables: Option<Tables>,
    field: Option<SurfelField>,
}

/// What a wide search looks things up in.
#[derive(Clone, Debug)]
struct Tables {
    search: LikelihoodPyramid,
    /// Fine and without levels: tells whether a point lies on something.
    near: LikelihoodPyramid,
}

/// An answer of the local matcher with the share of the scan that lies on surfaces of the
/// reference and could be seen there.
#[derive(Clone, Copy)]
struct Refined {
    result: MatchResult,
    explained: f64,
}

/// A scan with what of it lies on lines, if that is enough for the fast matcher.
struct PreparedScan<'a> {
    cloud: &'a PointCloud,
    lines: Option<Vec<LinePoint>>,
}

/// Answers nearer to each other than this are the same, metres and radians.
const SAME_M: f64 = 0.3;
const SAME_RAD: f64 = 0.2;
/// Answers farther apart than this are not the same even along a direction that is not observed.
const SAME_PLACE_M: f64 = 2.5;
/// Grid poses whose scores differ by less than this fit as well as one another.
const TIED: f32 = 0.04;
/// A pose that explains more than this share of a scan leaves nothing to be wished for.
const EXPLAINS_ALL: f64 = 0.95;
/// So many times more grid poses are refined where too many fit as well as the best.
const MORE: usize = 25;
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
        let prepared = self.prepare_scan(scan);
        let half_m = window.half_x_m.max(window.half_y_m);
        let mut settings = SearchSettings {
            min_score: s.min_score,
            candidates: s.candidates.max(1),
            below_best: s.below_best,
            separation_m: (APART * half_m).clamp(SAME_M, FARTHEST_APART_M),
            separation_rad: SAME_RAD,
            ..SearchSettings::default()
        };
        let refine = |candidate: &Candidate| {
            let result = self.refine(&prepared, &candidate.pose, prior);
            Refined { result, explained: self.explained(scan, &result.pose) }
        };
        loop {
            let found = self.candidates(scan, window, &settings);
            let refined: Vec<Refined> = found.iter().map(refine).collect();
            let Refined { result: best, explained } = self.choose(&refined, prior);
            // Two that explain all there is settle the matter.
            let ambiguous = matches!(best.status, MatchStatus::Ambiguous { .. });
            let settled = ambiguous && explained > EXPLAINS_ALL;
            match refined.last().filter(|_| is_cut_off(&found, &settings) && !settled) {
                None => return best,
                Some(last) if settings.candidates > s.candidates.max(1) => {
                    // There are more as good as the best than can be looked at.
                    let status = MatchStatus::Ambiguous { rival: last.result.pose };
                    return MatchResult { status, ..best };
                }
                Some(_) => {
                    settings.candidates *= MORE;
                    settings.below_best = TIED;
                }
            }
        }
    }

    /// The grid poses of a window at which a scan fits best, not refined; none if there are too few
    /// points or no tables.
    pub fn candidates(
        &self,
        scan: &PointCloud,
        window: &SearchWindow,
        settings: &SearchSettings,
    ) -> Vec<Candidate> {
        let scan = scan.in_order();
        let stride = scan.len().div_ceil(self.settings.search_points.max(1)).max(1);
        let points: Vec<Vector2<f32>> =
            scan.points.iter().step_by(stride).map(|p| p.position.cast()).collect();
        match &self.tables {
            Some(tables) if points.len() >= MIN_POINTS => {
                tables.search.search_many(&points, window, settings).candidates
            }
            _ => Vec::new(),
        }
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

    /// Share of a scan's points that lie within [`NEAR_M`] of something at a pose, and in front of
    /// which nothing stands in the way.
    fn explained(&self, scan: &PointCloud, pose: &Pose2) -> f64 {
        let Some(tables) = &self.tables else { return 0.0 };
        let as_f32 = |p: Vector2<f64>| (p.x as f32, p.y as f32);
        let half_m = SURFEL_SHARE * self.settings.field.cell_m;
        let explained = scan.points.iter().filter(|p| {
            let at = pose.transform(p.position);
            let (x, y) = tables.near.cell_of(&at);
            let clear = (p.range - CLOSE_BEHIND_M).max(0.0);
            let laser = p.position - p.ray * p.range;
            let (from, to) = (pose.transform(laser), pose.transform(laser + p.ray * clear));
            tables.near.value(0, x, y) >= ONE_SIGMA
                && self
                    .field
                    .as_ref()
                    .is_none_or(|field| !field.blocks(as_f32(from), as_f32(to), half_m))
        });
        explained.count() as f64 / scan.len().max(1) as f64
    }

    /// The answer that explains most of the scan; ambiguous if one elsewhere explains as much.
    fn choose(&self, refined: &[Refined], prior: &Prior) -> Refined {
        let usable = || refined.iter().filter(|answer| answer.result.status.is_usable());
        let merit = |answer: &Refined| answer.explained + answer.result.inlier_ratio;
        let most = |best: Option<Refined>, next: &Refined| match best {
            Some(best) if merit(&best) >= merit(next) => Some(best),
            _ => Some(*next),
        };
        let Some(best) = usable().fold(None, most) else {
            let result = MatchResult::failed(prior.pose, 0, MatchStatus::TooFewPoints);
            let nothing = Refined { result, explained: 0.0 };
            return refined.first().copied().unwrap_or(nothing);
        };
        let s = &self.settings;
        let as_good = |other: &&Refined| {
            other.explained > best.explained - s.rival_explained
                && other.result.inlier_ratio > best.result.inlier_ratio - s.rival_inliers
        };
        match usable().filter(as_good).find(|other| !is_same(&other.result, &best.result)) {
            Some(rival) => {
                let status = MatchStatus::Ambiguous { rival: rival.result.pose };
                Refined { result: MatchResult { status, ..best.result }, ..best }
            }
            None => best,
        }
    }
}

/// Whether there may be more grid poses as good as the best.
fn is_cut_off(found: &[Candidate], settings: &SearchSettings) -> bool {
    match (found.first(), found.last()) {
        (Some(best), Some(last)) => {
            found.len() >= settings.candidates && last.score > best.score - TIED
        }
        _ => false,
    }
}

/// Whether two answers are one: near each other, or apart along what the better one does not claim
/// to know.
fn is_same(other: &MatchResult, best: &MatchResult) -> bool {
    let apart = best.pose.between(&other.pose);
    let mut apart = Vector3::new(apart.x, apart.y, wrap_angle(apart.yaw));
    if let MatchStatus::Degenerate { weak_axis } = best.status {
        let along = weak_axis.dot(&apart).clamp(-SAME_PLACE_M, SAME_PLACE_M);
        apart -= weak_axis * along;
    }
    apart.xy().norm() < SAME_M && apart.z.abs() < SAME_RAD
}

/// Windows farther than this to each side are searched with cells and blur larger by the factor:
/// what is lost by that, refinement makes good.
const WIDE_M: f64 = 5.0;
const WIDE_FACTOR: f64 = 2.0;
/// A point this near to a reference point lies on something, metres; and the table that tells so.
const NEAR_M: f64 = 0.1;
const NEAR_CELL_M: f64 = 0.05;
/// The likelihood at one standard deviation, of 255.
const ONE_SIGMA: u8 = 154;
/// Half the length of a surfel that hides what is behind it, in cells: openings must stay open.
const SURFEL_SHARE: f32 = 0.6;
/// What stands less than this before a point does not hide it, metres.
const CLOSE_BEHIND_M: f64 = 0.3;
/// Fewer points than this are not searched for.
const MIN_POINTS: usize = 4;
