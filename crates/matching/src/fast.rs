use crate::normal_equations::{NormalEquations, PairWeights, linearise};
use crate::point_blocks::PointBlocks;
use crate::{LinePoint, MatchResult, MatchStatus, Prior, SurfelField};
use geometry::{Matrix3, Pose2, Vector3};
use serde::{Deserialize, Serialize};

/// Settings of the fast matcher.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FastSettings {
    /// Scale of the robust kernel in the first iteration, metres.
    pub kernel_start_m: f32,
    /// Scale of the robust kernel in the last iterations, metres.
    pub kernel_end_m: f32,
    /// How far from its surfel a point still counts as explained, metres: the scale of the same
    /// kernel for the inlier ratio.
    pub inlier_m: f32,
    /// Factor from one iteration's kernel scale to the next.
    pub kernel_decay: f32,
    /// Upper bound on iterations.
    pub max_iterations: u32,
    /// Stop when a step is smaller than this, metres (and radians at 5 m).
    pub step_m: f32,
    /// Cosine of the largest angle between a point's and its surfel's normal.
    pub normal_cos: f32,
    /// Ratio of the weakest to the strongest direction's information, metres and radians taken as
    /// they are, below which a match is called degenerate.
    pub degenerate_ratio: f64,
}

impl Default for FastSettings {
    fn default() -> Self {
        FastSettings {
            kernel_start_m: 0.3,
            kernel_end_m: 0.05,
            inlier_m: 0.07,
            kernel_decay: 0.6,
            max_iterations: 20,
            step_m: 2e-4,
            normal_cos: 0.7,
            degenerate_ratio: 1e-3,
        }
    }
}

impl FastSettings {
    fn pair_weights(&self, kernel_m: f32) -> PairWeights {
        PairWeights { kernel_m, inlier_m: self.inlier_m, normal_cos: self.normal_cos }
    }
}

/// Weighted point-to-line matching on a [`SurfelField`].
///
/// Each point's residual is its distance to its nearest surfel's line, weighted by both variances
/// along the normal (WSM's weights) and a Geman-McClure kernel whose scale shrinks from
/// `kernel_start_m` to `kernel_end_m`. Gauss-Newton on SE(2).
#[derive(Clone, Copy, Debug, Default)]
pub struct FastMatcher {
    /// The settings.
    pub settings: FastSettings,
}

impl FastMatcher {
    /// Finds `field_from_scan`, starting at the prior.
    pub fn align(&self, field: &SurfelField, scan: &[LinePoint], prior: &Prior) -> MatchResult {
        self.align_from(field, scan, &prior.pose, prior)
    }

    /// [`FastMatcher::align`] with a starting point that is not the prior's mean.
    pub fn align_from(
        &self,
        field: &SurfelField,
        scan: &[LinePoint],
        start: &Pose2,
        prior: &Prior,
    ) -> MatchResult {
        let s = &self.settings;
        let all = PointBlocks::new(scan.iter());
        let thinned = PointBlocks::new(scan.iter().step_by(COARSE_STEP));
        let mut pose = *start;
        let mut kernel = s.kernel_start_m;
        let mut iterations = 0;
        while iterations < s.max_iterations {
            iterations += 1;
            let last_kernel = kernel <= s.kernel_end_m;
            let coarse = kernel > 2.0 * s.kernel_end_m && scan.len() >= COARSE_FROM;
            let points = if coarse { &thinned } else { &all };
            let weights = s.pair_weights(kernel);
            let normal = if last_kernel {
                linearise::<true>(field, points, &pose, &weights)
            } else {
                linearise::<false>(field, points, &pose, &weights)
            };
            let Some(step) = solve(&normal, &pose, prior) else {
                return MatchResult::failed(pose, iterations, MatchStatus::TooFewPoints);
            };
            pose = Pose2::new(pose.x + step.x, pose.y + step.y, pose.yaw + step.z);
            let small =
                step.x.abs().max(step.y.abs()).max(5.0 * step.z.abs()) < f64::from(s.step_m);
            if small && last_kernel {
                // A step this small leaves what was found out about the fit as it is.
                return self.result(&normal, all.len, pose, iterations);
            }
            kernel = (kernel * s.kernel_decay).max(s.kernel_end_m);
        }
        self.conclude_blocks(field, &all, pose, iterations)
    }

    /// The match result at `pose`, without moving it.
    pub fn conclude(
        &self,
        field: &SurfelField,
        scan: &[LinePoint],
        pose: Pose2,
        iterations: u32,
    ) -> MatchResult {
        self.conclude_blocks(field, &PointBlocks::new(scan.iter()), pose, iterations)
    }

    fn conclude_blocks(
        &self,
        field: &SurfelField,
        points: &PointBlocks,
        pose: Pose2,
        iterations: u32,
    ) -> MatchResult {
        let s = &self.settings;
        let normal = linearise::<true>(field, points, &pose, &s.pair_weights(s.kernel_end_m));
        self.result(&normal, points.len, pose, iterations)
    }

    /// What the last linearisation says of the fit at `pose`.
    fn result(
        &self,
        normal: &NormalEquations,
        points: usize,
        pose: Pose2,
        iterations: u32,
    ) -> MatchResult {
        let information = information_in_scan_frame(normal, &pose);
        let inlier_ratio = f64::from(normal.inliers) / (points.max(1) as f64);
        if normal.pairs < 6 {
            return MatchResult::failed(pose, iterations, MatchStatus::TooFewPoints);
        }
        let (covariance, weak_axis) = invert(&information, self.settings.degenerate_ratio);
        let open_turn = open_turn(&information, YAW_RATIO * f64::from(normal.lever));
        let status = match weak_axis.or(open_turn) {
            None => MatchStatus::Converged,
            Some(weak_axis) => MatchStatus::Degenerate { weak_axis },
        };
        MatchResult { pose, covariance, inlier_ratio, iterations, status }
    }

    /// Information and gradient of the fit at `pose` as a right perturbation in the scan's frame:
    /// the quadratic model `1/2 d^T H d + g^T d` of the cost around the present estimate.
    pub fn quadratic(
        &self,
        field: &SurfelField,
        scan: &[LinePoint],
        pose: &Pose2,
        kernel_m: f32,
    ) -> (Matrix3<f64>, Vector3<f64>, f64) {
        let points = PointBlocks::new(scan.iter());
        let normal = linearise::<true>(field, &points, pose, &self.settings.pair_weights(kernel_m));
        let turn = turn(pose);
        let g = corrected(&normal).1;
        let inliers = f64::from(normal.inliers) / (scan.len().max(1) as f64);
        (information_in_scan_frame(&normal, pose), turn.transpose() * g, inliers)
    }
}

/// Less than this share of the information about yaw that points at their distance could give
/// means that none was seen. In a round room chords and noise of the normals pretend 0.001 to
/// 0.003; in other rooms it is about a third.
const YAW_RATIO: f64 = 5e-3;
/// In the first iterations, while the kernel is wide, every third point says enough.
const COARSE_STEP: usize = 3;
/// Scans with fewer points are never thinned.
const COARSE_FROM: usize = 90;

/// Rotation that takes a right (scan-frame) perturbation to field coordinates.
pub(crate) fn turn(pose: &Pose2) -> Matrix3<f64> {
    let (s, c) = pose.yaw.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// Information and gradient in field coordinates, corrected for the noise of the normals.
///
/// Errors in variables: noise in the normals makes `sum w n n^T` too large across the true normals,
/// by `sum w var(normal)`; in a corridor that would be all there is. The weak direction is taken
/// back to what is left, in the gradient as well, so that the minimum stays where it is.
fn corrected(n: &NormalEquations) -> (Matrix3<f64>, Vector3<f64>) {
    let [a, b, c, d, e, f] = n.h.map(f64::from);
    let full = Matrix3::new(a, b, c, b, d, e, c, e, f);
    let g = Vector3::new(n.g[0], n.g[1], n.g[2]).cast::<f64>();
    let eigen = nalgebra::Matrix2::new(a, b, b, d).symmetric_eigen();
    let k = eigen.eigenvalues.imin();
    let (weak, v) = (eigen.eigenvalues[k], eigen.eigenvectors.column(k).into_owned());
    let kept = (weak - f64::from(n.pretended)).max(0.01 * weak);
    let scale = (kept / weak.max(1e-9)).sqrt().min(1.0);
    let p = nalgebra::Matrix2::identity() - v * v.transpose() * (1.0 - scale);
    let mut s = Matrix3::identity();
    s.fixed_view_mut::<2, 2>(0, 0).copy_from(&p);
    (s * full * s, s * s * g)
}

fn information_in_scan_frame(n: &NormalEquations, pose: &Pose2) -> Matrix3<f64> {
    let turn = turn(pose);
    turn.transpose() * corrected(n).0 * turn
}

/// One Gauss-Newton step in field coordinates, the prior included.
fn solve(n: &NormalEquations, pose: &Pose2, prior: &Prior) -> Option<Vector3<f64>> {
    if n.pairs < 6 {
        return None;
    }
    let turn = turn(&prior.pose);
    let prior_information = turn * prior.information * turn.transpose();
    let offset = Vector3::new(
        pose.x - prior.pose.x,
        pose.y - prior.pose.y,
        geometry::wrap_angle(pose.yaw - prior.pose.yaw),
    );
    let (h, g) = corrected(n);
    let g = g + prior_information * offset;
    let mut h = h + prior_information;
    // Just enough damping to make directions that nothing observes stand still.
    h[(0, 0)] += 1.0;
    h[(1, 1)] += 1.0;
    h[(2, 2)] += 1.0;
    let step = -(h.cholesky()?.solve(&g));
    step.iter().all(|v| v.is_finite()).then_some(step)
}

/// The turn that hardly moves any point across its surface, as in a round room: `None` if the
/// information about yaw, whatever the translation, is at least `least`.
fn open_turn(information: &Matrix3<f64>, least: f64) -> Option<Vector3<f64>> {
    let translation = information.fixed_view::<2, 2>(0, 0).try_inverse()?;
    let coupling = information.fixed_view::<2, 1>(0, 2).into_owned();
    let follow = -translation * coupling;
    let about_yaw = information[(2, 2)] + coupling.dot(&follow);
    (about_yaw < least).then(|| Vector3::new(follow.x, follow.y, 1.0).normalize())
}

/// Covariance of an information matrix, and its weak axis if one direction is hardly observed.
fn invert(information: &Matrix3<f64>, ratio: f64) -> (Matrix3<f64>, Option<Vector3<f64>>) {
    let eigen = information.symmetric_eigen();
    let strongest = eigen.eigenvalues.max().max(1e-9);
    let floor = strongest * 1e-9;
    let inverse = eigen.eigenvalues.map(|v| 1.0 / v.max(floor));
    let covariance =
        eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
    let weakest = eigen.eigenvalues.imin();
    let weak = eigen.eigenvalues[weakest] < ratio * strongest;
    (covariance, weak.then(|| eigen.eigenvectors.column(weakest).into_owned()))
}
