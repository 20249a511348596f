mod cells;

use crate::closest::{ARM_M, scale, weak_axis};
use crate::fast::turn;
use crate::{MatchResult, MatchStatus, Matcher, PointCloud, Prior};
use cells::Cells;
use geometry::{LieGroup, Matrix2, Matrix3, Pose2, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Settings of [`NdtMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NdtSettings {
    /// Side of the largest cells, metres; each further resolution has half of it.
    pub coarsest_m: f64,
    /// Number of resolutions.
    pub resolutions: u32,
    /// Fewer points than this make no cell.
    pub min_points: usize,
    /// A cell's smaller variance is at least this share of its larger one ...
    pub flatness: f64,
    /// ... and so many times that share at each coarser resolution: walls must be felt from afar.
    pub widening: f64,
    /// Upper bound on Newton steps per resolution.
    pub max_iterations: u32,
    /// A step shorter than this, metres (and radians at 5 m), ends a resolution.
    pub step_m: f64,
    /// A smaller share of explained points is no better than chance.
    pub min_inlier_ratio: f64,
    /// A result farther from the start than this has left the search region, metres.
    pub max_shift_m: f64,
    /// See `ClosestSettings::degenerate_ratio`.
    pub degenerate_ratio: f64,
}

impl Default for NdtSettings {
    fn default() -> Self {
        NdtSettings {
            coarsest_m: 2.0,
            resolutions: 3,
            min_points: 3,
            flatness: 1e-3,
            widening: 10.0,
            max_iterations: 40,
            step_m: 1e-4,
            min_inlier_ratio: 0.15,
            max_shift_m: 3.0,
            degenerate_ratio: 5e-3,
        }
    }
}

/// The Normal Distributions Transform (Biber and Strasser, IROS 2003): the reference is a normal
/// distribution per cell, in four grids shifted by half a cell, and the scan's score is climbed by
/// Newton steps.
///
/// Undamped, as the thesis had it, Newton hardly ever moves far: the score is flat or curved the
/// wrong way except near its top. Here steps are damped until the score grows
/// (Levenberg-Marquardt), from large cells to small ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct NdtMatcher {
    /// The settings.
    pub settings: NdtSettings,
}

/// The cost `-sum exp(-r^T B r / 2)` at a pose, its gradient and Hessian by `(x, y, yaw)`.
#[derive(Clone, Copy, Default)]
struct Cost {
    value: f64,
    g: Vector3<f64>,
    h: Matrix3<f64>,
    /// Sum of the squared gradients of the points.
    spread: Matrix3<f64>,
    explained: usize,
}

/// A point within three standard deviations of a cell is explained by it.
const EXPLAINED: f64 = 0.011;

impl Cost {
    fn of(cells: &Cells, scan: &PointCloud, pose: &Pose2) -> Self {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let mut cost = Cost::default();
        for point in &scan.points {
            let turned = rotation * point.position;
            let derivatives = [Vector2::x(), Vector2::y(), Vector2::new(-turned.y, turned.x)];
            let mut gradient = Vector3::zeros();
            let mut best = 0.0f64;
            for (mean, information) in cells.at(&(turned + pose.translation())) {
                let r = turned + pose.translation() - mean;
                let br = information * r;
                let e = (-0.5 * r.dot(&br)).exp();
                best = best.max(e);
                cost.value -= e;
                let slopes = Vector3::from(derivatives.map(|d| br.dot(&d)));
                gradient += slopes * e;
                for (j, dj) in derivatives.iter().enumerate() {
                    for (k, dk) in derivatives.iter().enumerate() {
                        let curved = if j == 2 && k == 2 { br.dot(&-turned) } else { 0.0 };
                        cost.h[(j, k)] +=
                            e * (dj.dot(&(information * dk)) + curved - slopes[j] * slopes[k]);
                    }
                }
            }
            cost.g += gradient;
            cost.spread += gradient * gradient.transpose();
            cost.explained += usize::from(best > EXPLAINED);
        }
        cost
    }

    /// The same with a prior, `(x - x_0)^T P (x - x_0) / 2`.
    fn with_prior(mut self, pose: &Pose2, prior: &Prior) -> Self {
        let turn = turn(&prior.pose);
        let information = turn * prior.information * turn.transpose();
        let offset = Vector3::new(
            pose.x - prior.pose.x,
            pose.y - prior.pose.y,
            geometry::wrap_angle(pose.yaw - prior.pose.yaw),
        );
        self.value += 0.5 * offset.dot(&(information * offset));
        self.g += information * offset;
        self.h += information;
        self
    }
}

impl NdtMatcher {
    /// Climbs at one resolution; the pose, the iterations and whether it settled.
    fn climb(
        &self,
        cells: &Cells,
        scan: &PointCloud,
        start: Pose2,
        prior: &Prior,
    ) -> (Pose2, u32, bool) {
        let cost = |pose: &Pose2| Cost::of(cells, scan, pose).with_prior(pose, prior);
        let mut pose = start;
        let mut here = cost(&pose);
        let mut damping = 1e-3;
        for iteration in 0..self.settings.max_iterations {
            let scale = here.h.diagonal().abs().max().max(1e-9);
            let damped = here.h + scale_of_yaw() * (damping * scale);
            let step = damped.cholesky().map(|factor| -factor.solve(&here.g));
            let Some(step) = step.filter(|s| s.iter().all(|v| v.is_finite())) else {
                damping *= 10.0;
                continue;
            };
            let length = step.xy().norm().max(ARM_M * step.z.abs());
            if length < self.settings.step_m {
                return (pose, iteration, true);
            }
            let next = Pose2::new(pose.x + step.x, pose.y + step.y, pose.yaw + step.z);
            let there = cost(&next);
            if there.value < here.value && length < 1.0 {
                (pose, here) = (next, there);
                damping = (damping * 0.3).max(1e-9);
            } else {
                damping *= 10.0;
            }
        }
        (pose, self.settings.max_iterations, false)
    }
}

/// Damping by metres, a radian at [`ARM_M`].
fn scale_of_yaw() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, ARM_M * ARM_M))
}

impl Matcher for NdtMatcher {
    fn name(&self) -> &'static str {
        "ndt"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let s = &self.settings;
        let finite = |cloud: &PointCloud| PointCloud {
            points: cloud.points.iter().filter(|p| p.position.norm() < 1e4).copied().collect(),
        };
        let (reference, scan) = (finite(reference), finite(scan));
        let (mut pose, mut iterations, mut settled) = (prior.pose, 0, false);
        let mut cells = Cells::default();
        for resolution in (0..s.resolutions.clamp(1, 10)).rev() {
            let finest_m = s.coarsest_m * 0.5f64.powi(s.resolutions.clamp(1, 10) as i32 - 1);
            let side_m = finest_m * 2f64.powi(resolution as i32);
            let flatness = s.flatness * s.widening.powi(resolution as i32);
            cells = Cells::new(&reference, side_m, flatness.min(1.0), s.min_points);
            let (climbed, taken, done) = self.climb(&cells, &scan, pose, prior);
            (pose, settled) = (climbed, done);
            iterations += taken;
        }
        let here = Cost::of(&cells, &scan, &pose);
        if here.explained < 6 || scan.len() < 6 {
            return MatchResult::failed(prior.pose, iterations, MatchStatus::TooFewPoints);
        }
        if !settled || !pose.is_finite() || pose.distance(&prior.pose) > s.max_shift_m {
            return MatchResult::failed(prior.pose, iterations, MatchStatus::Diverged);
        }
        conclude(&here, pose, iterations, here.explained as f64 / scan.len() as f64, s)
    }
}

/// Covariance `H^-1 (2 sum g g^T) H^-1`: the spread of the gradient as the scan's points show it,
/// and once more for the reference's.
fn conclude(
    here: &Cost,
    pose: Pose2,
    iterations: u32,
    inlier_ratio: f64,
    s: &NdtSettings,
) -> MatchResult {
    let turn = turn(&pose);
    let (h, spread) =
        (turn.transpose() * here.h * turn, turn.transpose() * here.spread * turn * 2.0);
    let scale = scale();
    let eigen = (scale * h * scale).symmetric_eigen();
    let most = eigen.eigenvalues.max();
    if most <= 0.0 {
        return MatchResult::failed(pose, iterations, MatchStatus::Diverged);
    }
    let inverse = eigen.eigenvalues.map(|v| 1.0 / v.max(1e-6 * most));
    let inverse = scale
        * (eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose())
        * scale;
    let covariance = inverse * spread * inverse;
    let status = match weak_axis(&h, s.degenerate_ratio) {
        _ if inlier_ratio < s.min_inlier_ratio => MatchStatus::Diverged,
        Some(weak_axis) => MatchStatus::Degenerate { weak_axis },
        None => MatchStatus::Converged,
    };
    let covariance = 0.5 * (covariance + covariance.transpose());
    MatchResult { pose, covariance, inlier_ratio, iterations, status }
}
