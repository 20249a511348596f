use crate::SlamConfig;
use crate::active_submap::ActiveSubmap;
use crate::climbing::{Climbing, Stance};
use crate::elevation::unknown_rise;
use crate::localiser::{Expectation, Localised, Localiser, SightedScan};
use crate::map::Map;
use crate::odometer::{Motion, Odometer};
use geometry::{GaussianPose2, Matrix3, Pose2, Vector2, Vector3};
use manifold::{Elevation, INTERVAL_95, Patch, PatchId, Provenance, Way};
use matching::{LinePoint, MatchResult};
use sensing::Observation;
use std::sync::Arc;

/// Incremental localisation and mapping of one robot (thesis, algorithm 5.2).
#[derive(Clone, Debug)]
pub(crate) struct FrontEnd {
    config: SlamConfig,
    localiser: Localiser,
    submap: ActiveSubmap,
    anchor_from_base: Pose2,
    odometer: Odometer,
    climbing: Climbing,
    last_motion: Pose2,
    last_patch: Option<PatchId>,
    /// Where the first patch of a piece of map is put.
    start: Pose2,
    /// The patch it is related to, and how.
    bridge: Option<(PatchId, GaussianPose2)>,
    /// Covariance added by disagreement of odometry and matches since the last patch.
    doubt: Matrix3<f64>,
}

/// Where a scan was localised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Localisation {
    pub patch: PatchId,
    pub patch_from_base: Pose2,
    /// Covariance of `patch_from_base`; none at a patch.
    pub covariance: Matrix3<f64>,
    pub is_patch: bool,
    pub recovered: bool,
    /// Share of the scan that the submap explains; 1 for the first scan and those not matched.
    pub explained: f64,
    /// From where it was expected to where it was found.
    pub shift: Pose2,
    /// Rise of the ground per metre forwards and to the left, in the base's frame.
    pub slope: Vector2<f64>,
    /// The robot had fallen over: the scan was not matched.
    pub tipped: bool,
}

impl FrontEnd {
    pub fn new(config: SlamConfig) -> Self {
        FrontEnd {
            config,
            localiser: Localiser::new(config),
            submap: ActiveSubmap::new(config.field),
            anchor_from_base: Pose2::IDENTITY,
            odometer: Odometer::new(config.odometry),
            climbing: Climbing::new(config.elevation),
            last_motion: Pose2::IDENTITY,
            last_patch: None,
            start: Pose2::IDENTITY,
            bridge: None,
            doubt: Matrix3::zeros(),
        }
    }

    /// Puts an observation's odometry on the plan, before anything else.
    pub fn level_odometry(&mut self, observation: &mut Observation) {
        self.climbing.level_odometry(observation);
    }

    /// Puts its scan and surface on the plan, before [`FrontEnd::process`].
    pub fn level(&self, observation: &mut Observation, surface: &mut Vec<LinePoint>) -> Stance {
        self.climbing.level(observation, surface)
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
            return self.start_piece(observation, scan, map);
        };
        let motion = self.odometer.read(&observation, &self.last_motion);
        self.localise(motion, last_patch, observation, scan, map)
    }

    /// Follows a robot that has fallen over by its odometry, without looking at its scan.
    pub fn follow(
        &mut self,
        observation: Observation,
        scan: &[LinePoint],
        map: &mut Map,
    ) -> Localisation {
        if self.last_patch.is_none() {
            return Localisation { tipped: true, ..self.start_piece(observation, scan, map) };
        }
        let motion = self.odometer.read(&observation, &self.last_motion).expected;
        self.odometer.distrust();
        self.doubt += motion.covariance;
        self.move_by(motion.mean);
        let (patch, anchor_from_patch) = self.submap.nearest(&self.anchor_from_base, 1.0);
        let patch_from_base = anchor_from_patch.between(&self.anchor_from_base);
        Localisation {
            patch,
            patch_from_base,
            covariance: motion.covariance,
            is_patch: false,
            recovered: false,
            explained: 1.0,
            shift: Pose2::IDENTITY,
            slope: self.climbing.slope(),
            tipped: true,
        }
    }

    fn move_by(&mut self, motion: Pose2) {
        self.last_motion = motion;
        self.anchor_from_base = self.anchor_from_base * motion;
        self.climbing.moved(&motion);
    }

    fn localise(
        &mut self,
        motion: Motion,
        last_patch: PatchId,
        observation: Observation,
        scan: &[LinePoint],
        map: &mut Map,
    ) -> Localisation {
        let expected = self.expect(&motion);
        let surface = self.climbing.comparable(scan, &self.slope_expected(&expected, map));
        let sighted = SightedScan {
            scan: &observation.scan,
            base_from_laser: observation.base_from_laser,
            surface: &surface,
        };
        let Localised { best: result, first_was_poor: poor, confirmed } =
            self.localiser.find(&sighted, &expected, &self.submap, map);
        if confirmed > 0 {
            self.odometer.distrust();
        }
        let expected = &expected.poses[confirmed];
        let pose = if result.status.is_usable() { result.pose } else { expected.mean };
        let shift = expected.mean.between(&pose);
        self.note_disagreement(&shift, expected, &result, poor);
        self.last_motion = self.anchor_from_base.between(&pose);
        self.anchor_from_base = pose;
        self.climbing.moved(&self.last_motion);
        let (patch, patch_from_base, is_patch) = if self.must_extend(&result) {
            let patch = self.extend(observation, scan, &result, expected, map);
            self.note_odometry(last_patch, patch, map);
            (patch, Pose2::IDENTITY, true)
        } else {
            let (patch, anchor_from_patch) = self.submap.nearest(&pose, 1.0);
            (patch, anchor_from_patch.between(&pose), false)
        };
        let explained = result.inlier_ratio;
        let covariance = match is_patch {
            true => Matrix3::zeros(),
            false => self.config.relation_covariance(&result.covariance, Some(expected)),
        };
        let recovered = poor;
        Localisation {
            patch,
            patch_from_base,
            covariance,
            is_patch,
            recovered,
            explained,
            shift,
            slope: self.climbing.slope(),
            tipped: false,
        }
    }

    /// Slope of the ground at the nearest patch, in the frame that the scan is expected to have.
    fn slope_expected(&self, expected: &Expectation, map: &Map) -> Vector2<f64> {
        let pose = &expected.poses[0].mean;
        let (patch, anchor_from_patch) = self.submap.nearest(pose, 1.0);
        let base_from_patch = pose.between(&anchor_from_patch);
        base_from_patch.rotate(map.slope(patch))
    }

    /// Where the scan may have been taken, in the submap's frame.
    fn expect(&self, motion: &Motion) -> Expectation {
        let last = self.anchor_from_base;
        let poses = std::iter::once(motion.expected).chain(motion.alternative);
        Expectation {
            poses: poses.map(|m| GaussianPose2 { mean: last * m.mean, ..m }).collect(),
            undecided: motion.silent && motion.alternative.is_none(),
            after_gap: motion.after_gap,
            last_resorts: [last * self.last_motion, last],
        }
    }

    /// Begins another piece of map with the next scan, whose pose is given: nothing relates it to
    /// what was mapped before.
    pub fn restart(&mut self, island_from_base: Pose2) {
        // What the inertial unit reads on the level stays known.
        let climbing = self.climbing.clone();
        *self = FrontEnd { start: island_from_base, climbing, ..FrontEnd::new(self.config) };
    }

    /// Relates the first patch of the next piece to an earlier one after all.
    pub fn bridge(&mut self, from: PatchId, relation: GaussianPose2) {
        self.bridge = Some((from, relation));
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

    fn start_piece(
        &mut self,
        observation: Observation,
        scan: &[LinePoint],
        map: &mut Map,
    ) -> Localisation {
        self.odometer.read(&observation, &Pose2::IDENTITY);
        self.odometer.new_patch();
        self.climbing.new_patch();
        let bridge = self.bridge.take();
        let elevation = observation.attitude.map(|_| ground_of_piece(bridge.as_ref(), map));
        map.slopes.push(self.climbing.slope());
        let patch = add_patch(observation, scan, self.start, elevation, map);
        if let Some((from, relation)) = bridge {
            map.manifold.relate(from, patch, relation, Provenance::Sequential);
        }
        self.last_patch = Some(patch);
        self.relocate(map, patch);
        Localisation {
            patch,
            patch_from_base: Pose2::IDENTITY,
            covariance: Matrix3::zeros(),
            is_patch: true,
            recovered: false,
            explained: 1.0,
            shift: Pose2::IDENTITY,
            slope: self.climbing.slope(),
            tipped: false,
        }
    }

    /// Odometry and a match that contradict each other: where the match is not decisive, or was
    /// only found from another start, either may be wrong. The next relation is doubted by as much
    /// as they differ, so that loop closing looks around there.
    fn note_disagreement(
        &mut self,
        difference: &Pose2,
        expected: &GaussianPose2,
        result: &MatchResult,
        recovered: bool,
    ) {
        let predicted = GaussianPose2 { mean: Pose2::IDENTITY, ..*expected };
        let distance2 = predicted.mahalanobis_squared(difference).unwrap_or(0.0);
        if distance2 < DISAGREEMENT_SIGMAS * DISAGREEMENT_SIGMAS {
            return;
        }
        let mut doubted = difference.coordinates();
        if !recovered || result.inlier_ratio > self.config.extension.explained {
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
        map.slopes.push(self.climbing.slope());
        let patch = add_patch(observation, scan, pose, None, map);
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
        let motion = self
            .odometer
            .new_patch()
            .map(|motion| GaussianPose2 { covariance: motion.covariance + self.doubt, ..motion });
        let climb = self.climbing.new_patch();
        if motion.is_some() || climb.is_some() {
            map.manifold.note_way(Way { from: last, to: patch, motion, climb });
        }
        let elevation = self.climbing.elevation(map.manifold.patch(last).elevation, climb);
        map.manifold.elevate(elevation.map(|height| (patch, height)).into_iter().collect());
        self.last_patch = Some(patch);
        self.doubt = Matrix3::zeros();
    }
}

/// A match this good settles where the robot is, whatever odometry says: metres, metres, radians.
const DECISIVE_STD: [f64; 3] = [0.05, 0.05, 0.02];
/// Odometry and match contradict each other beyond this many standard deviations of the motion
/// model.
const DISAGREEMENT_SIGMAS: f64 = 4.0;

/// The height at which a piece of map begins: zero, or what the bridge to an earlier piece leaves
/// known.
fn ground_of_piece(bridge: Option<&(PatchId, GaussianPose2)>, map: &Map) -> Elevation {
    let before = bridge.and_then(|(from, relation)| {
        let from = map.manifold.patch(*from).elevation?;
        Some(unknown_rise(from, relation.mean.norm()))
    });
    before.unwrap_or(Elevation { height_m: 0.0, variance_m2: 0.0 })
}

fn add_patch(
    observation: Observation,
    scan: &[LinePoint],
    pose: Pose2,
    elevation: Option<Elevation>,
    map: &mut Map,
) -> PatchId {
    map.surfaces.push(scan.to_vec());
    map.manifold.add_patch(Patch {
        id: PatchId::default(),
        robot: observation.robot,
        stamp: observation.stamp,
        scan: Arc::new(observation.scan),
        sweep: observation.sweep,
        base_from_laser: observation.base_from_laser,
        attitude: observation.attitude,
        island_from_patch: pose,
        elevation,
        left_out: false,
    })
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
