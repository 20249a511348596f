use crate::SlamConfig;
use crate::active_submap::ActiveSubmap;
use crate::map::Map;
use crate::plausibility::Plausibility;
use crate::recovery::{Recovery, window_around};
use geometry::{GaussianPose2, Matrix3, Pose2};
use matching::{
    FastMatcher, FastSettings, LinePoint, MatchResult, MatcherKind, PointCloud, PointCloudSettings,
    Prior,
};
use sensing::Scan;

/// Finds where in its local submap a scan was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Localiser {
    config: SlamConfig,
    recovery: Recovery,
    /// The matcher to take in place of the fast one.
    chosen: Option<MatcherKind>,
}

/// A scan with the surfaces it shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SightedScan<'a> {
    pub scan: &'a Scan,
    pub base_from_laser: Pose2,
    pub surface: &'a [LinePoint],
}

/// What is expected of a scan's pose before it is matched, in the submap's frame.
#[derive(Clone, Debug)]
pub(crate) struct Expectation {
    /// The poses that may be, with the motion's doubt, the most likely first; at least one.
    pub poses: Vec<GaussianPose2>,
    /// Odometry may be held up, and tells nothing.
    pub undecided: bool,
    /// Nothing was seen for longer than usual.
    pub after_gap: bool,
    /// Where else a match may start when the fit is poor.
    pub last_resorts: [Pose2; 2],
}

/// The outcome of matching one scan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Localised {
    pub best: MatchResult,
    pub first_was_poor: bool,
    /// Of the poses that were expected, the one that the match confirms best.
    pub confirmed: usize,
}

/// A pose whose sight lines pass through known walls by more than this share is refuted.
const CONTRADICTING_SHARE: f64 = 0.1;
/// A match this many standard deviations of the motion model from what was expected is tried again
/// more strictly.
const CONTRADICTION_SIGMAS: f64 = 3.0;
/// A match first looks this many standard deviations around, a turn taken at this distance, metres.
const LOOK_SIGMAS: f64 = 1.5;
const LOOK_ARM_M: f64 = 3.0;

/// Other matchers than the fast one take so many patches as their reference, the nearest.
const REFERENCE_PATCHES: usize = 8;

impl Localiser {
    pub fn new(config: SlamConfig) -> Self {
        let chosen = Some(config.front_end).filter(|kind| *kind != MatcherKind::Fast);
        Localiser { config, recovery: Recovery::new(&config), chosen }
    }

    /// Matches a scan from where it is expected, and from other starting points when that fit is
    /// poor, contradicts odometry or follows a gap.
    pub fn find(
        &self,
        sighted: &SightedScan,
        expected: &Expectation,
        submap: &ActiveSubmap,
        map: &Map,
    ) -> Localised {
        let e = &self.config.extension;
        let scan = sighted.surface;
        let poses = &expected.poses;
        let judged: &[GaussianPose2] = if expected.undecided { &[] } else { poses };
        let mut plausibility = Plausibility::new(judged, scan.len());
        let mut best = self.nearby(sighted, poses, submap, map, &plausibility);
        let first_was_poor = best.inlier_ratio < e.recover_below;
        if best.inlier_ratio < e.explained {
            plausibility.refuted = contradicts(sighted, poses, submap);
            let mut starts: Vec<Pose2> = poses.iter().map(|pose| pose.mean).collect();
            if first_was_poor {
                starts.extend(expected.last_resorts);
            }
            best = self.recovery.turn(scan, submap, &starts, best, &plausibility);
        }
        if best.inlier_ratio < if expected.after_gap { e.explained } else { e.recover_below } {
            let window = window_around(&poses[poses.len() - 1]);
            best = self.recovery.search(scan, submap, map, &window, best, &plausibility);
        }
        let confirmed = plausibility.nearest(&best).map_or(0, |(index, _)| index);
        Localised { best, first_was_poor, confirmed }
    }

    /// The most plausible match from the poses expected.
    fn nearby(
        &self,
        scan: &SightedScan,
        poses: &[GaussianPose2],
        submap: &ActiveSubmap,
        map: &Map,
        plausibility: &Plausibility,
    ) -> MatchResult {
        let field = &submap.field;
        let align = |pose| match self.chosen {
            None => self.looking_near(pose).align(field, scan.surface, &self.prior(pose)),
            Some(chosen) => self.align_chosen(chosen, scan, pose, submap, map),
        };
        let best = poses[1..]
            .iter()
            .fold(align(&poses[0]), |best, pose| plausibility.better(best, align(pose)));
        if plausibility.distance2(&best) <= CONTRADICTION_SIGMAS * CONTRADICTION_SIGMAS {
            return best;
        }
        // Something that moves along, a person walking ahead, may have drawn the match away.
        let strict = self.matcher(self.config.matcher.kernel_end_m);
        poses.iter().fold(best, |best, pose| {
            let again = strict.align(field, scan.surface, &self.prior(pose));
            let stay = strict.conclude(field, scan.surface, pose.mean, 0);
            plausibility.better(plausibility.better(best, again), stay)
        })
    }

    /// Another matcher's answer, its fit judged like those of the fast one.
    fn align_chosen(
        &self,
        chosen: MatcherKind,
        scan: &SightedScan,
        expected: &GaussianPose2,
        submap: &ActiveSubmap,
        map: &Map,
    ) -> MatchResult {
        let settings = PointCloudSettings::default();
        let mut reference = PointCloud::default();
        for (patch, pose) in submap.nearest_members(&expected.mean, REFERENCE_PATCHES) {
            let patch = map.manifold.patch(patch);
            let cloud = PointCloud::from_scan(&patch.scan, &patch.base_from_laser, &settings);
            reference.extend(&cloud.transformed(&pose));
        }
        let own = PointCloud::from_scan(scan.scan, &scan.base_from_laser, &settings);
        let found = chosen.build().align(&reference, &own, &self.prior(expected));
        let fast = self.matcher(self.config.matcher.kernel_end_m);
        let judged = fast.conclude(&submap.field, scan.surface, found.pose, found.iterations);
        MatchResult { inlier_ratio: judged.inlier_ratio, ..found }
    }

    /// The matcher that looks no farther than the doubt about where the scan is expected: what lies
    /// beyond, somebody walking ahead for example, must not draw the match away.
    fn looking_near(&self, expected: &GaussianPose2) -> FastMatcher {
        let c = &expected.covariance;
        let doubt2 = c[(0, 0)] + c[(1, 1)] + LOOK_ARM_M * LOOK_ARM_M * c[(2, 2)];
        let settings = &self.config.matcher;
        let doubt_m = (LOOK_SIGMAS * doubt2.sqrt()) as f32;
        self.matcher(doubt_m.max(settings.kernel_end_m).min(settings.kernel_start_m))
    }

    fn matcher(&self, kernel_start_m: f32) -> FastMatcher {
        FastMatcher { settings: FastSettings { kernel_start_m, ..self.config.matcher } }
    }

    /// The prior of a match. Residuals of neighbouring beams are not independent, so a match claims
    /// more than it knows; `match_correlation` weighs the motion up against it.
    fn prior(&self, expected: &GaussianPose2) -> Prior {
        let information = expected.covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
        Prior { pose: expected.mean, information: information * self.config.match_correlation }
    }
}

/// True when the scan would look through walls of the map at each of the poses.
fn contradicts(scan: &SightedScan, poses: &[GaussianPose2], submap: &ActiveSubmap) -> bool {
    poses.iter().all(|pose| {
        let share = submap.seen_through(scan.surface, &pose.mean, &scan.base_from_laser);
        share > CONTRADICTING_SHARE
    })
}
