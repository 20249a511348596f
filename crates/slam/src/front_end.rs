use crate::SlamConfig;
use crate::active_submap::ActiveSubmap;
use crate::map::Map;
use crate::plausibility::Plausibility;
use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use manifold::{INTERVAL_95, PatchId, Provenance};
use matching::{FastMatcher, FastSettings, LinePoint, MatchResult, Prior};
use sensing::{Observation, Stamp};
use std::sync::Arc;

/// Incremental localisation and mapping of one robot (thesis, algorithm 5.2).
#[derive(Clone, Debug)]
pub(crate) struct FrontEnd {
    config: SlamConfig,
    matcher: FastMatcher,
    submap: ActiveSubmap,
    anchor_from_base: Pose2,
    last_stamp: Option<Stamp>,
    last_odometry: Option<Pose2>,
    last_motion: Pose2,
    last_patch: Option<PatchId>,
    /// Odometry since the last patch: motion, distance driven, angle turned.
    since_patch: Option<(Pose2, f64, f64)>,
    /// Covariance added by disagreement of odometry and matches since the last patch.
    doubt: Matrix3<f64>,
}

/// The outcome of matching one scan.
struct Localised {
    best: MatchResult,
    first_was_poor: bool,
}

/// Where a scan was localised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Localisation {
    pub patch: PatchId,
    pub patch_from_base: Pose2,
    pub is_patch: bool,
    pub recovered: bool,
    /// Share of the scan that the submap explains; 1 for the first scan.
    pub explained: f64,
}

impl FrontEnd {
    pub fn new(config: SlamConfig) -> Self {
        FrontEnd {
            config,
            matcher: FastMatcher { settings: config.matcher },
            submap: ActiveSubmap::new(config.field),
            anchor_from_base: Pose2::IDENTITY,
            last_stamp: None,
            last_odometry: None,
            last_motion: Pose2::IDENTITY,
            last_patch: None,
            since_patch: None,
            doubt: Matrix3::zeros(),
        }
    }

    /// Localises a scan in the local submap and extends the manifold if the fit says so. Odometry
    /// that is not to be used is taken out of the observation before.
    pub fn process(
        &mut self,
        observation: Observation,
        scan: &[LinePoint],
        map: &mut Map,
    ) -> Localisation {
        let Some(last_patch) = self.last_patch else {
            return self.start_island(observation, scan, map);
        };
        let blind = self.blind_secs(observation.stamp);
        let mut motion = self.measure_motion(observation.odom_from_base);
        motion.covariance += Matrix3::from_diagonal(
            &Vector3::from(BLIND_STD_PER_SEC).map(|std| (std * blind).powi(2)),
        );
        let prior = self.predict(&motion);
        let result = self.localise(scan, &prior, &motion, blind > 0.0);
        let poor = result.first_was_poor;
        let result = result.best;
        let pose = if result.status.is_usable() { result.pose } else { prior.pose };
        self.note_disagreement(&prior.pose.between(&pose), &motion, &result, poor);
        self.last_motion = self.anchor_from_base.between(&pose);
        self.anchor_from_base = pose;
        let (patch, patch_from_base, is_patch) = if self.must_extend(&result) {
            let patch = self.extend(observation, scan, &result, &motion, map);
            self.note_odometry(last_patch, patch, map);
            (patch, Pose2::IDENTITY, true)
        } else {
            let (patch, anchor_from_patch) = self.submap.nearest(&pose, 1.0);
            (patch, anchor_from_patch.between(&pose), false)
        };
        let explained = result.inlier_ratio;
        Localisation { patch, patch_from_base, is_patch, recovered: poor, explained }
    }

    /// Where the scan was taken: matched from the prior, and from other starting points when that
    /// fit is poor, contradicts odometry or follows a gap.
    fn localise(
        &self,
        scan: &[LinePoint],
        prior: &Prior,
        motion: &GaussianPose2,
        after_gap: bool,
    ) -> Localised {
        let e = &self.config.extension;
        let field = &self.submap.field;
        let predicted = GaussianPose2 { mean: prior.pose, ..*motion };
        let silent = self.last_odometry.is_some() && motion.mean == Pose2::IDENTITY;
        let plausibility = Plausibility::new(predicted, scan.len(), silent);
        let mut best = self.matcher.align(field, scan, prior);
        if plausibility.distance2(&best) > CONTRADICTION_SIGMAS * CONTRADICTION_SIGMAS {
            // Something that moves along, a person walking ahead, may have drawn the match away.
            let kernel_start_m = self.config.matcher.kernel_end_m;
            let settings = FastSettings { kernel_start_m, ..self.config.matcher };
            let strict = FastMatcher { settings }.align(field, scan, prior);
            best = plausibility.better(best, strict);
            best = plausibility.better(best, self.matcher.conclude(field, scan, prior.pose, 0));
        }
        let first_was_poor = best.inlier_ratio < e.recover_below;
        if first_was_poor || after_gap || best.inlier_ratio < e.explained {
            let rings = if first_was_poor || after_gap { ALL_RINGS } else { FEW_RINGS };
            best = self.recover(scan, prior, best, rings, &plausibility);
        }
        Localised { best, first_was_poor }
    }

    /// After a refit moved the map: lays the submap anew around `patch`, the robot staying where it
    /// is seen from there.
    pub fn relocate(&mut self, map: &Map, patch: PatchId) {
        let anchor_from_patch =
            self.submap.members.iter().find(|m| m.0 == patch).map_or(Pose2::IDENTITY, |m| m.1);
        self.anchor_from_base = anchor_from_patch.between(&self.anchor_from_base);
        let margin = 0.5 * self.config.submap.distance_m;
        self.submap.rebuild(map, patch, &self.config.submap, margin);
    }

    fn start_island(
        &mut self,
        observation: Observation,
        scan: &[LinePoint],
        map: &mut Map,
    ) -> Localisation {
        self.last_odometry = observation.odom_from_base;
        let patch = add_patch(observation, scan, Pose2::IDENTITY, map);
        self.last_patch = Some(patch);
        self.since_patch = Some((Pose2::IDENTITY, 0.0, 0.0));
        self.relocate(map, patch);
        Localisation {
            patch,
            patch_from_base: Pose2::IDENTITY,
            is_patch: true,
            recovered: false,
            explained: 1.0,
        }
    }

    /// How much longer than usual nothing was seen, seconds. Odometry in such gaps is not to be
    /// trusted: it may have been held up as well. Stamps that jump back say nothing.
    fn blind_secs(&mut self, stamp: Stamp) -> f64 {
        let last = self.last_stamp.replace(stamp).unwrap_or(stamp);
        let gap = stamp.secs_since(last);
        if (0.0..MAX_GAP_SECS).contains(&gap) { (gap - USUAL_GAP_SECS).max(0.0) } else { 0.0 }
    }

    /// The motion since the last scan: by odometry where there is some, else as before.
    fn measure_motion(&mut self, odometry: Option<Pose2>) -> GaussianPose2 {
        let motion = match (self.last_odometry, odometry) {
            (Some(last), Some(now)) => Some(last.between(&now)),
            _ => None,
        };
        self.last_odometry = odometry;
        self.since_patch = match (self.since_patch, motion) {
            (Some((sum, distance, turn)), Some(m)) => {
                Some((sum * m, distance + m.norm(), turn + m.yaw.abs()))
            }
            _ => None,
        };
        match motion {
            Some(motion) => self.config.odometry.gaussian(motion),
            None => self.config.odometry.guess(self.last_motion),
        }
    }

    /// The prior of the next match. Residuals of neighbouring beams are not independent, so a match
    /// claims more than it knows; `match_correlation` weighs the motion up against it.
    fn predict(&self, motion: &GaussianPose2) -> Prior {
        let information = motion.covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
        Prior {
            pose: self.anchor_from_base * motion.mean,
            information: information * self.config.match_correlation,
        }
    }

    /// Odometry and a match that contradict each other: where the match is not decisive, or was
    /// only found from another start, either may be wrong. The next relation is doubted by as much
    /// as they differ, so that loop closing looks around there.
    fn note_disagreement(
        &mut self,
        difference: &Pose2,
        motion: &GaussianPose2,
        result: &MatchResult,
        recovered: bool,
    ) {
        let predicted = GaussianPose2 { mean: Pose2::IDENTITY, ..*motion };
        let distance2 = predicted.mahalanobis_squared(difference).unwrap_or(0.0);
        if distance2 < DISAGREEMENT_SIGMAS * DISAGREEMENT_SIGMAS {
            return;
        }
        let mut doubted = difference.coordinates();
        if !recovered {
            let matched = result.covariance * self.config.match_correlation;
            let decisive = Vector3::from(DECISIVE_STD);
            let decisive = Matrix3::from_diagonal(&decisive.component_mul(&decisive));
            let inverse = (matched + decisive).try_inverse().unwrap_or_else(Matrix3::zeros);
            doubted = matched * inverse * doubted;
        }
        let reach2 = doubted.xy().norm_squared();
        let turn2 = doubted.z * doubted.z;
        self.doubt += Matrix3::from_diagonal(&Vector3::new(reach2, reach2, turn2));
    }

    /// Tries other starting points when the fit from the prior is poor: odometry may have slipped,
    /// frozen or jumped. Turns are tried in growing rings, and the first ring with a good fit wins:
    /// indoors a wrong turn of 90 or 180 degrees often fits as well as the right small one.
    fn recover(
        &self,
        scan: &[LinePoint],
        prior: &Prior,
        first: MatchResult,
        rings: u32,
        plausibility: &Plausibility,
    ) -> MatchResult {
        let e = &self.config.extension;
        let starts = [self.anchor_from_base * self.last_motion, self.anchor_from_base, prior.pose];
        let thinned: Vec<LinePoint> = scan.iter().step_by(RECOVERY_STEP).copied().collect();
        let field = &self.submap.field;
        let mut best = first;
        for turn in (0..rings).flat_map(ring) {
            for start in &starts {
                let guess = Prior::guess(*start * Pose2::new(0.0, 0.0, turn));
                let result = self.matcher.align(field, &thinned, &guess);
                let turned = start.between(&result.pose).yaw.abs();
                if result.status.is_usable()
                    && turned < turn.abs() + RING_RAD
                    && result.inlier_ratio > best.inlier_ratio + e.recover_gain
                    && plausibility.of(&result) > plausibility.of(&best)
                {
                    best = result;
                }
            }
            // Both turns of a ring are tried before it may win.
            if turn >= 0.0 && best.inlier_ratio > e.explained {
                break;
            }
        }
        if best == first {
            return first;
        }
        let refined = self.matcher.align(field, scan, &Prior::guess(best.pose));
        plausibility.better(first, refined)
    }

    /// True when the submap does not know the scan's surroundings well enough (algorithm 5.2, lines
    /// 4 to 7), or the robot has left the neighbourhood of its patches.
    fn must_extend(&self, result: &MatchResult) -> bool {
        let e = &self.config.extension;
        let interval = |i: usize| INTERVAL_95 * result.covariance[(i, i)].max(0.0).sqrt();
        let (_, nearest) = self.submap.nearest(&self.anchor_from_base, e.distance_m / e.turn_rad);
        let delta = nearest.between(&self.anchor_from_base);
        interval(0) > e.translation_m
            || interval(1) > e.translation_m
            || interval(2) > e.rotation_rad
            || result.inlier_ratio < e.explained
            || delta.norm() / e.distance_m + delta.yaw.abs() / e.turn_rad > 1.0
    }

    fn extend(
        &mut self,
        observation: Observation,
        scan: &[LinePoint],
        result: &MatchResult,
        motion: &GaussianPose2,
        map: &mut Map,
    ) -> PatchId {
        let (from, anchor_from_from) = self.submap.nearest(&self.anchor_from_base, 1.0);
        let from_from_to = anchor_from_from.between(&self.anchor_from_base);
        let pose = map.pose(from) * from_from_to;
        let patch = add_patch(observation, scan, pose, map);
        let covariance =
            self.config.relation_covariance(&result.covariance, Some(motion)) + self.doubt;
        let relation = GaussianPose2 { mean: from_from_to, covariance };
        map.manifold.relate(from, patch, relation, Provenance::Sequential);
        self.submap.push(patch, self.anchor_from_base, scan);
        if self.anchor_from_base.norm() > 0.25 * self.config.submap.distance_m {
            self.relocate(map, patch);
        }
        patch
    }

    fn note_odometry(&mut self, last: PatchId, patch: PatchId, map: &mut Map) {
        if let Some((motion, distance, turn)) = self.since_patch {
            let mut gaussian = self.config.odometry.gaussian_along(motion, distance, turn);
            gaussian.covariance += self.doubt;
            map.odometry.push((last, patch, gaussian));
        }
        self.last_patch = Some(patch);
        self.since_patch = Some((Pose2::IDENTITY, 0.0, 0.0));
        self.doubt = Matrix3::zeros();
    }
}

/// The turns of a ring, radians: to the right and to the left.
fn ring(ring: u32) -> impl Iterator<Item = f64> {
    let turn = f64::from(ring) * 0.5 * RING_RAD;
    [-turn, turn].into_iter().skip(usize::from(ring == 0))
}

/// A match started from a ring may turn this much farther than the ring, radians; rings are half as
/// far apart.
const RING_RAD: f64 = 0.35;
/// Starting points are compared on every second point.
const RECOVERY_STEP: usize = 2;
/// Rings of ten degrees that are searched after a poor fit, and after a fair one.
const ALL_RINGS: u32 = 10;
const FEW_RINGS: u32 = 3;
/// Scans this far apart are nothing unusual, seconds; farther apart than the other, the log was
/// stopped.
const USUAL_GAP_SECS: f64 = 1.0;
const MAX_GAP_SECS: f64 = 60.0;
/// What a robot may have done unseen, per second of a gap: metres, metres, radians.
const BLIND_STD_PER_SEC: [f64; 3] = [0.1, 0.1, 0.3];
/// A match this good settles where the robot is, whatever odometry says: metres, metres, radians.
const DECISIVE_STD: [f64; 3] = [0.05, 0.05, 0.02];
/// A match this many standard deviations of the motion model from odometry is tried again more
/// strictly.
const CONTRADICTION_SIGMAS: f64 = 3.0;
/// Odometry and match contradict each other beyond this many standard deviations of the motion
/// model.
const DISAGREEMENT_SIGMAS: f64 = 4.0;

fn add_patch(observation: Observation, scan: &[LinePoint], pose: Pose2, map: &mut Map) -> PatchId {
    map.surfaces.push(scan.to_vec());
    map.manifold.add_patch(
        observation.robot,
        observation.stamp,
        Arc::new(observation.scan),
        observation.base_from_laser,
        pose,
    )
}

impl SlamConfig {
    /// Covariance of a relation from that of its match: the match's claim weighed down by
    /// `match_correlation`, together with the motion measured, plus the error that does not show in
    /// residuals (`relation_floor`).
    pub(crate) fn relation_covariance(
        &self,
        matched: &Matrix3<f64>,
        motion: Option<&GaussianPose2>,
    ) -> Matrix3<f64> {
        let information = |c: &Matrix3<f64>| c.try_inverse().unwrap_or_else(Matrix3::zeros);
        let matched = information(&(matched * self.match_correlation));
        let moved = motion.map_or_else(Matrix3::zeros, |m| information(&m.covariance));
        let floor = self.relation_floor;
        let std = Vector3::new(floor.translation_m, floor.translation_m, floor.rotation_rad);
        let fused = matched + moved + Matrix3::identity() * 1e-3;
        information(&fused) + Matrix3::from_diagonal(&std.component_mul(&std))
    }
}
