use super::choice::{Refined, SAME_M, SAME_RAD, choose};
use super::tables::Tables;
use super::{CombinedMatcher, CombinedSettings};
use crate::{
    Candidate, LinePoint, MatchResult, MatchStatus, PointCloud, Prior, SearchSettings,
    SearchWindow, SurfelField, WsmMatcher,
};
use geometry::{Pose2, Vector2};

/// A reference made ready by [`CombinedMatcher::prepare`].
#[derive(Clone, Debug)]
pub struct CombinedReference<'a> {
    settings: CombinedSettings,
    reference: &'a PointCloud,
    tables: Option<Tables>,
    field: Option<SurfelField>,
}

/// A scan with what of it lies on lines, if that is enough for the fast matcher.
struct PreparedScan<'a> {
    cloud: &'a PointCloud,
    lines: Option<Vec<LinePoint>>,
}

/// Successive points on surfaces farther apart than this lie on two, metres and share of the range.
const BREAK_M: f64 = 0.2;
const BREAK_SHARE: f64 = 0.05;
/// Grid poses whose scores differ by less than this fit as well as one another.
const TIED: f32 = 0.06;
/// A pose that explains more than this share of a scan leaves nothing to be wished for.
const EXPLAINS_ALL: f64 = 0.95;
/// So many times more grid poses are refined where too many fit as well as the best.
const MORE: usize = 25;
/// Grid poses of a search are at least this share of its window apart, and no more than
/// [`FARTHEST_APART_M`].
const APART: f64 = 0.3;
const FARTHEST_APART_M: f64 = 1.0;

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

impl CombinedReference<'_> {
    /// Matches a scan from a good guess.
    pub fn align(&self, scan: &PointCloud, prior: &Prior) -> MatchResult {
        self.refine(&self.prepare_scan(scan), &prior.pose, prior)
    }

    /// Searches a window for a scan, refines what was found and says whether another place fits as
    /// well.
    pub fn search(&self, scan: &PointCloud, window: &SearchWindow, prior: &Prior) -> MatchResult {
        if self.tables.is_none() || scan.len().min(self.reference.len()) < MIN_POINTS {
            return MatchResult::failed(prior.pose, 0, MatchStatus::TooFewPoints);
        }
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
            let Refined { result: best, explained } = choose(&refined, prior, s);
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
    fn candidates(
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

    fn explained(&self, scan: &PointCloud, pose: &Pose2) -> f64 {
        self.tables.as_ref().map_or(0.0, |t| t.explained(scan, pose, self.field.as_ref()))
    }

    fn prepare_scan<'b>(&self, cloud: &'b PointCloud) -> PreparedScan<'b> {
        let lines = self.settings.local().line_points(cloud);
        let on_walls = on_long_surfaces(&lines, self.settings.wall_m);
        let walls = on_walls as f64 >= self.settings.walls * cloud.len() as f64;
        PreparedScan { cloud, lines: (walls && self.field.is_some()).then_some(lines) }
    }

    /// The local matcher that suits the scan, from a starting point.
    fn refine(&self, scan: &PreparedScan<'_>, start: &Pose2, prior: &Prior) -> MatchResult {
        let s = &self.settings;
        if let (Some(field), Some(lines)) = (&self.field, &scan.lines) {
            return s.local().align_with(field, lines, start, prior);
        }
        let matcher = WsmMatcher { settings: s.scattered };
        matcher.align_from(self.reference, scan.cloud, start, prior)
    }
}

/// How many of a scan's points, in the order of its beams, lie on surfaces of at least this length.
fn on_long_surfaces(points: &[LinePoint], length_m: f64) -> usize {
    let distance = |a: &LinePoint, b: &LinePoint| f64::from((a.x - b.x).hypot(a.y - b.y));
    let continues = |pair: &[LinePoint]| {
        let [a, b] = pair else { return false };
        distance(a, b) < BREAK_M + BREAK_SHARE * f64::from(a.x.hypot(a.y))
    };
    let mut count = 0;
    let mut start = 0;
    for end in 1..=points.len() {
        if end < points.len() && continues(&points[end - 1..=end]) {
            continue;
        }
        if distance(&points[start], &points[end - 1]) >= length_m {
            count += end - start;
        }
        start = end;
    }
    count
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

/// Fewer points than this are not searched for.
const MIN_POINTS: usize = 4;
