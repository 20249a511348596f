use crate::SlamConfig;
use crate::active_submap::{ActiveSubmap, PatchPoints};
use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use manifold::{Manifold, PatchId, Provenance};
use matching::{FastMatcher, LinePoint, MatchResult, Prior};
use sensing::Observation;
use std::sync::Arc;

/// Incremental localisation and mapping of one robot (algorithm 5.2).
#[derive(Clone, Debug)]
pub(crate) struct FrontEnd {
    config: SlamConfig,
    matcher: FastMatcher,
    pub submap: ActiveSubmap,
    anchor_from_base: Pose2,
    last_odometry: Option<Pose2>,
    last_motion: Pose2,
    started: bool,
}

/// Where a scan was localised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Localisation {
    pub patch: PatchId,
    pub patch_from_base: Pose2,
    pub is_patch: bool,
    pub result: Option<MatchResult>,
}

impl FrontEnd {
    pub fn new(config: SlamConfig) -> Self {
        FrontEnd {
            config,
            matcher: FastMatcher { settings: config.matcher },
            submap: ActiveSubmap::new(config.field),
            anchor_from_base: Pose2::IDENTITY,
            last_odometry: None,
            last_motion: Pose2::IDENTITY,
            started: false,
        }
    }

    pub fn process(
        &mut self,
        observation: Observation,
        scan: Vec<LinePoint>,
        manifold: &mut Manifold,
        points: &mut PatchPoints,
    ) -> Localisation {
        if !std::mem::replace(&mut self.started, true) {
            self.last_odometry = observation.odom_from_base;
            return self.start_island(observation, scan, manifold, points);
        }
        let prior = self.predict(observation.odom_from_base);
        let mut result = self.matcher.align(&self.submap.field, &scan, &prior);
        if result.inlier_ratio < self.config.extension.recover_below {
            result = self.recover(&scan, &prior, result);
        }
        let pose = if result.status.is_usable() { result.pose } else { prior.pose };
        self.last_motion = self.anchor_from_base.between(&pose);
        self.anchor_from_base = pose;
        if self.must_extend(&result) {
            self.extend(observation, scan, &result, &prior, manifold, points)
        } else {
            let (patch, anchor_from_patch) = self.submap.nearest(&pose, 1.0);
            let patch_from_base = anchor_from_patch.between(&pose);
            Localisation { patch, patch_from_base, is_patch: false, result: Some(result) }
        }
    }

    fn start_island(
        &mut self,
        observation: Observation,
        scan: Vec<LinePoint>,
        manifold: &mut Manifold,
        points: &mut PatchPoints,
    ) -> Localisation {
        let patch = manifold.add_patch(
            observation.robot,
            observation.stamp,
            Arc::new(observation.scan),
            observation.base_from_laser,
            Pose2::IDENTITY,
        );
        points.push(scan);
        self.rebuild(manifold, points, patch);
        self.anchor_from_base = Pose2::IDENTITY;
        Localisation { patch, patch_from_base: Pose2::IDENTITY, is_patch: true, result: None }
    }

    /// The prior for the next match: odometry where there is some, else the last motion again.
    fn predict(&mut self, odometry: Option<Pose2>) -> Prior {
        let o = &self.config.odometry;
        let odometry = odometry.filter(|_| o.enabled);
        let motion = match (self.last_odometry, odometry) {
            (Some(last), Some(now)) => Some(last.between(&now)),
            _ => None,
        };
        self.last_odometry = odometry;
        let Some(motion) = motion else {
            return Prior::guess(self.anchor_from_base * self.last_motion);
        };
        let (distance, turn) = (motion.norm(), motion.yaw.abs());
        let translation =
            o.translation_floor_m + o.translation_per_m * distance + o.translation_per_rad_m * turn;
        let rotation =
            o.rotation_floor_rad + o.rotation_per_rad * turn + o.rotation_per_m_rad * distance;
        let (t, r) = (o.weight * translation.powi(-2), o.weight * rotation.powi(-2));
        let information = Matrix3::from_diagonal(&Vector3::new(t, t, r));
        Prior { pose: self.anchor_from_base * motion, information }
    }

    /// Tries other starting points when the fit from the prior is poor: odometry may have slipped or
    /// frozen. Keeps the first result unless another explains clearly more of the scan.
    fn recover(&self, scan: &[LinePoint], prior: &Prior, first: MatchResult) -> MatchResult {
        let mut best = first;
        let starts = [prior.pose, self.anchor_from_base * self.last_motion, self.anchor_from_base];
        let turns = (0..=9).flat_map(|k| [10.0 * k as f64, -10.0 * k as f64]).skip(1);
        for turn in turns {
            for start in starts {
                let pose = start * Pose2::new(0.0, 0.0, turn.to_radians());
                let result = self.matcher.align(&self.submap.field, scan, &Prior::guess(pose));
                let margin = if best == first { 0.1 } else { 0.0 };
                if result.status.is_usable() && result.inlier_ratio > best.inlier_ratio + margin {
                    best = result;
                }
            }
        }
        best
    }

    fn must_extend(&self, result: &MatchResult) -> bool {
        let e = &self.config.extension;
        let interval = |i: usize| 1.96 * result.covariance[(i, i)].max(0.0).sqrt();
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
        scan: Vec<LinePoint>,
        result: &MatchResult,
        prior: &Prior,
        manifold: &mut Manifold,
        points: &mut PatchPoints,
    ) -> Localisation {
        let (from, anchor_from_from) = self.submap.nearest(&self.anchor_from_base, 1.0);
        let from_from_to = anchor_from_from.between(&self.anchor_from_base);
        let information = result.covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
        let covariance = (information + prior.information / self.config.odometry.weight + Matrix3::identity() * 1e-3)
            .try_inverse()
            .unwrap_or(result.covariance)
            * 4.0;
        let f = &self.config.closing;
        let covariance = covariance
            + Matrix3::from_diagonal(&Vector3::new(f.floor_t, f.floor_t, f.floor_r).map(|v| v * v));
        let island_from_patch = manifold.patch(from).island_from_patch * from_from_to;
        let patch = manifold.add_patch(
            observation.robot,
            observation.stamp,
            Arc::new(observation.scan),
            observation.base_from_laser,
            island_from_patch,
        );
        let relation = GaussianPose2 { mean: from_from_to, covariance };
        manifold.relate(from, patch, relation, Provenance::Sequential);
        self.submap.push(patch, self.anchor_from_base, &scan);
        points.push(scan);
        if self.anchor_from_base.norm() > 0.25 * self.config.submap.distance_m {
            self.rebuild(manifold, points, patch);
        }
        Localisation {
            patch,
            patch_from_base: Pose2::IDENTITY,
            is_patch: true,
            result: Some(*result),
        }
    }

    /// After a refit moved the map: stay where the robot is seen from `patch`.
    pub fn relocate(&mut self, manifold: &Manifold, points: &PatchPoints, patch: PatchId) {
        let (_, anchor_from_patch) = self
            .submap
            .members
            .iter()
            .find(|m| m.0 == patch)
            .copied()
            .unwrap_or((patch, Pose2::IDENTITY));
        self.anchor_from_base = anchor_from_patch.between(&self.anchor_from_base);
        let margin = 0.5 * self.config.submap.distance_m;
        self.submap.rebuild(manifold, points, patch, &self.config.submap, margin);
    }

    /// Makes `patch` the anchor of a fresh submap, keeping the robot where it is.
    pub fn rebuild(&mut self, manifold: &Manifold, points: &PatchPoints, patch: PatchId) {
        let old = manifold.patch(self.submap.anchor).island_from_patch * self.anchor_from_base;
        self.anchor_from_base = manifold.patch(patch).island_from_patch.between(&old);
        let margin = 0.5 * self.config.submap.distance_m;
        self.submap.rebuild(manifold, points, patch, &self.config.submap, margin);
    }
}
