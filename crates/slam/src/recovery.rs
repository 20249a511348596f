use crate::active_submap::ActiveSubmap;
use crate::map::Map;
use crate::plausibility::Plausibility;
use crate::{ExtensionSettings, SlamConfig};
use geometry::{GaussianPose2, Pose2, Vector2};
use matching::{FastMatcher, LinePoint, MatchResult, Prior, SearchSettings, SearchWindow};
use std::f64::consts::PI;

/// Finds a scan that does not fit where it was expected: odometry may have slipped, frozen or
/// jumped, or nothing was seen for a while.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recovery {
    extension: ExtensionSettings,
    matcher: FastMatcher,
}

/// A match started from a ring may turn this much farther than the ring, radians; rings are half as
/// far apart.
const RING_RAD: f64 = 0.35;
/// Starting points are compared on every second point.
const THINNING: usize = 2;
/// Rings of ten degrees that are tried.
const RINGS: u32 = 3;
/// The wide search looks this many standard deviations around, but at least and at most so far:
/// metres and radians.
const SIGMAS: f64 = 3.0;
const NEAREST_M: f64 = 1.0;
const FARTHEST_M: f64 = 3.0;
const NEAREST_RAD: f64 = 1.8;
/// Grid poses of the wide search that are refined.
const CANDIDATES: usize = 5;
/// Likelihood a grid pose must reach: half of the scan may be new.
const MIN_SCORE: f32 = 0.4;
/// Windows the wide search may examine.
const MAX_WINDOWS: usize = 20_000;

impl Recovery {
    pub fn new(config: &SlamConfig) -> Self {
        Recovery { extension: config.extension, matcher: FastMatcher { settings: config.matcher } }
    }

    /// Tries turns in growing rings around `starts`; the first ring with a good fit wins: indoors a
    /// wrong turn of 90 or 180 degrees often fits as well as the right small one.
    pub fn turn(
        &self,
        scan: &[LinePoint],
        submap: &ActiveSubmap,
        starts: &[Pose2],
        first: MatchResult,
        plausibility: &Plausibility,
    ) -> MatchResult {
        let thinned: Vec<LinePoint> = scan.iter().step_by(THINNING).copied().collect();
        let mut best = first;
        for turn in (0..RINGS).flat_map(ring) {
            for start in starts {
                let guess = Prior::guess(*start * Pose2::new(0.0, 0.0, turn));
                let result = self.matcher.align(&submap.field, &thinned, &guess);
                let turned = start.between(&result.pose).yaw.abs();
                if turned < turn.abs() + RING_RAD && self.is_gain(&result, &best, plausibility) {
                    best = result;
                }
            }
            // Both turns of a ring are tried before it may win.
            if turn >= 0.0 && best.inlier_ratio > self.extension.explained {
                break;
            }
        }
        self.refined(scan, submap, first, best, plausibility)
    }

    /// Searches all poses in `window` by branch and bound, and refines the best.
    pub fn search(
        &self,
        scan: &[LinePoint],
        submap: &ActiveSubmap,
        map: &Map,
        window: &SearchWindow,
        first: MatchResult,
        plausibility: &Plausibility,
    ) -> MatchResult {
        let pyramid = submap.pyramid(map);
        let points: Vec<Vector2<f32>> =
            scan.iter().step_by(THINNING).map(|p| Vector2::new(p.x, p.y)).collect();
        let settings = SearchSettings {
            min_score: MIN_SCORE,
            candidates: CANDIDATES,
            max_windows: MAX_WINDOWS,
            ..SearchSettings::default()
        };
        let found = pyramid.search_many(&points, window, &settings);
        let mut best = first;
        for candidate in found.candidates {
            let result = self.matcher.align(&submap.field, scan, &Prior::guess(candidate.pose));
            if self.is_gain(&result, &best, plausibility) {
                best = result;
            }
        }
        best
    }

    /// True when `result` explains noticeably more than `best` and is more plausible all in all.
    fn is_gain(
        &self,
        result: &MatchResult,
        best: &MatchResult,
        plausibility: &Plausibility,
    ) -> bool {
        result.status.is_usable()
            && result.inlier_ratio > best.inlier_ratio + self.extension.recover_gain
            && plausibility.of(result) > plausibility.of(best)
    }

    fn refined(
        &self,
        scan: &[LinePoint],
        submap: &ActiveSubmap,
        first: MatchResult,
        best: MatchResult,
        plausibility: &Plausibility,
    ) -> MatchResult {
        if best == first {
            return first;
        }
        let refined = self.matcher.align(&submap.field, scan, &Prior::guess(best.pose));
        plausibility.better(first, refined)
    }
}

/// The turns of a ring, radians: to the right and to the left.
fn ring(ring: u32) -> impl Iterator<Item = f64> {
    let turn = f64::from(ring) * 0.5 * RING_RAD;
    [-turn, turn].into_iter().skip(usize::from(ring == 0))
}

/// Where a wide search around an expected pose looks.
pub(crate) fn window_around(expected: &GaussianPose2) -> SearchWindow {
    let half = |i: usize| SIGMAS * expected.covariance[(i, i)].sqrt();
    let half_m = half(0).max(half(1)).clamp(NEAREST_M, FARTHEST_M);
    SearchWindow {
        centre: expected.mean,
        half_x_m: half_m,
        half_y_m: half_m,
        half_yaw_rad: half(2).clamp(NEAREST_RAD, PI),
    }
}
