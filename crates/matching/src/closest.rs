//! What ICP and its descendants share: every scan point is paired with the closest reference point,
//! the worst pairs are dropped, a weighted sum of squared distances is minimised, and so on until
//! the pose settles. They differ in the weight of a pair alone: all ways alike (ICP), across the
//! reference's line (PL-ICP), or by the planes on both sides (GICP).

mod pairs;
mod uncertainty;

use crate::{CloudPoint, MatchResult, MatchStatus, NeighbourTree, PointCloud, Prior};
use geometry::{LieGroup, Matrix2, Matrix3, Pose2, Vector2, Vector3};
use nalgebra::Matrix2x3;
pub(crate) use pairs::ClosestPair;
use pairs::{closest_pairs, drop_worst};
use serde::{Deserialize, Serialize};
pub(crate) use uncertainty::{RangeErrors, sliding_covariance};

/// Settings of the matchers that iterate closest points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClosestSettings {
    /// Pairs farther apart than this are not made in the first iterations, metres ...
    pub gate_start_m: f64,
    /// ... and in the last.
    pub gate_end_m: f64,
    /// Factor from one gate to the next.
    pub gate_decay: f64,
    /// Share of the pairs kept, those with the smallest error.
    pub keep: f64,
    /// Of those, pairs are dropped whose error is more than so many times ...
    pub adaptive_factor: f64,
    /// ... that of this quantile; infinity for the factor drops none.
    pub adaptive_quantile: f64,
    /// Cosine of the largest angle between the normals of a pair; -1 pairs anything.
    pub normal_cos: f64,
    /// Standard deviation of a range, metres, for the covariance.
    pub range_std_m: f64,
    /// Upper bound on iterations.
    pub max_iterations: u32,
    /// A step shorter than this (metres; radians at 5 m) at the last gate ends the iteration.
    pub step_m: f64,
    /// Fewer pairs than this are no match.
    pub min_pairs: usize,
    /// A smaller share of paired points is no better than chance.
    pub min_inlier_ratio: f64,
    /// A result farther from the start than this has left the search region, metres.
    pub max_shift_m: f64,
    /// Ratio of the weakest to the strongest direction's information, yaw taken at 5 m, below which
    /// a match is called degenerate.
    pub degenerate_ratio: f64,
}

impl Default for ClosestSettings {
    fn default() -> Self {
        ClosestSettings {
            gate_start_m: 1.0,
            gate_end_m: 0.1,
            gate_decay: 0.7,
            keep: 0.9,
            adaptive_factor: f64::INFINITY,
            adaptive_quantile: 0.7,
            normal_cos: -1.0,
            range_std_m: 0.015,
            max_iterations: 60,
            step_m: 2e-4,
            min_pairs: 8,
            min_inlier_ratio: 0.15,
            max_shift_m: 3.0,
            degenerate_ratio: 5e-3,
        }
    }
}

/// Metres that a radian is taken for.
pub(crate) const ARM_M: f64 = 5.0;
/// The gate narrows once a step is shorter than this share of it.
const SETTLED_SHARE: f64 = 0.05;

/// A scan at a pose with its pairs.
pub(crate) struct Linearisation {
    pub pairs: Vec<ClosestPair>,
    /// Information and gradient of half the cost, as a right perturbation in the scan's frame.
    pub h: Matrix3<f64>,
    pub g: Vector3<f64>,
}

/// The weight of a pair: the information of the distance between its points, in the reference
/// frame. `None` where the points' surfaces are not known well enough to tell.
pub(crate) trait PairWeight: Sync {
    fn of(&self, pair: &ClosestPair, rotation: &Matrix2<f64>) -> Option<Matrix2<f64>>;
}

/// What of the reference a scan point is compared with.
pub(crate) trait Correspondence: Sync {
    /// The reference's index and the point itself, if there is one within the gate.
    fn closest(&self, moved: &Vector2<f64>, gate_m: f64) -> Option<(usize, CloudPoint)>;
}

/// The nearest of the reference's points.
pub(crate) struct NearestPoint<'a> {
    reference: &'a PointCloud,
    tree: NeighbourTree,
}

impl<'a> NearestPoint<'a> {
    pub fn of(reference: &'a PointCloud) -> Self {
        let tree = NeighbourTree::new(reference.points.iter().map(|p| p.position));
        NearestPoint { reference, tree }
    }
}

impl Correspondence for NearestPoint<'_> {
    fn closest(&self, moved: &Vector2<f64>, gate_m: f64) -> Option<(usize, CloudPoint)> {
        let (index, _) = self.tree.nearest(*moved, gate_m * gate_m)?;
        Some((index, self.reference.points[index]))
    }
}

/// An iteration over two clouds.
pub(crate) struct ClosestPoints<'a, C, W> {
    pub settings: &'a ClosestSettings,
    pub correspondence: &'a C,
    pub weight: &'a W,
    pub scan: &'a PointCloud,
}

impl<C: Correspondence, W: PairWeight> ClosestPoints<'_, C, W> {
    /// Finds `reference_from_scan`; `covariance` tells that of the outcome as a right perturbation.
    pub fn align(
        &self,
        prior: &Prior,
        covariance: impl Fn(&Linearisation, &Pose2) -> Option<Matrix3<f64>>,
    ) -> MatchResult {
        let s = self.settings;
        let mut pose = prior.pose;
        let mut gate = s.gate_start_m;
        let (mut iterations, mut step_length) = (0, f64::INFINITY);
        while iterations < s.max_iterations && !(step_length < s.step_m && gate <= s.gate_end_m) {
            iterations += 1;
            let here = self.linearise(&pose, gate);
            let step = solve(&here, &pose, prior, s.degenerate_ratio)
                .filter(|_| here.pairs.len() >= s.min_pairs);
            let Some(step) = step else {
                return MatchResult::failed(pose, iterations, MatchStatus::TooFewPoints);
            };
            pose = pose.retract(&step);
            step_length = step.xy().norm().max(ARM_M * step.z.abs());
            if !pose.is_finite() || pose.distance(&prior.pose) > s.max_shift_m {
                return MatchResult::failed(prior.pose, iterations, MatchStatus::Diverged);
            }
            if step_length < SETTLED_SHARE * gate {
                gate = (gate * s.gate_decay).max(s.gate_end_m);
            }
        }
        // Pairs may swap for ever between two equally good sets: small steps are settled enough.
        if step_length > 0.1 * s.gate_end_m {
            return MatchResult::failed(pose, iterations, MatchStatus::Diverged);
        }
        self.conclude(&pose, iterations, covariance)
    }

    fn conclude(
        &self,
        pose: &Pose2,
        iterations: u32,
        covariance: impl Fn(&Linearisation, &Pose2) -> Option<Matrix3<f64>>,
    ) -> MatchResult {
        let s = self.settings;
        let here = self.linearise(pose, s.gate_end_m);
        let inlier_ratio = here.pairs.len() as f64 / self.scan.len().max(1) as f64;
        let covariance = covariance(&here, pose).filter(|c| c.iter().all(|v| v.is_finite()));
        let Some(covariance) = covariance.filter(|_| here.pairs.len() >= s.min_pairs) else {
            return MatchResult::failed(*pose, iterations, MatchStatus::TooFewPoints);
        };
        let status = match weak_axis(&here.h, s.degenerate_ratio) {
            _ if inlier_ratio < s.min_inlier_ratio => MatchStatus::Diverged,
            Some(weak_axis) => MatchStatus::Degenerate { weak_axis },
            None => MatchStatus::Converged,
        };
        MatchResult { pose: *pose, covariance, inlier_ratio, iterations, status }
    }

    /// Pairs the scan at a pose and sums what they say.
    fn linearise(&self, pose: &Pose2, gate_m: f64) -> Linearisation {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let s = self.settings;
        let mut pairs = closest_pairs(self.correspondence, self.scan, pose, gate_m);
        pairs.retain_mut(|pair| {
            let agree = pair.normals_agree(&rotation, s.normal_cos);
            pair.weigh(self.weight.of(pair, &rotation).filter(|_| agree))
        });
        drop_worst(&mut pairs, s);
        let (mut h, mut g) = (Matrix3::zeros(), Vector3::zeros());
        for pair in &pairs {
            let jacobian = pair.jacobian(&rotation);
            let weighted = jacobian.transpose() * pair.weight;
            h += weighted * jacobian;
            g -= weighted * pair.residual;
        }
        Linearisation { pairs, h, g }
    }
}

impl ClosestPair {
    /// Derivative of the moved scan point by a right perturbation `(x, y, yaw)`.
    pub fn jacobian(&self, rotation: &Matrix2<f64>) -> Matrix2x3<f64> {
        let b = self.scan.position;
        rotation * Matrix2x3::new(1.0, 0.0, -b.y, 0.0, 1.0, b.x)
    }
}

/// One Gauss-Newton step, the prior included. Directions that neither pairs nor prior observe stand
/// still: what little pulls along a corridor is noise (Zhang, Kaess, Singh, "On degeneracy of
/// optimization-based state estimation problems", ICRA 2016).
fn solve(here: &Linearisation, pose: &Pose2, prior: &Prior, ratio: f64) -> Option<Vector3<f64>> {
    let offset = prior.pose.between(pose).log();
    let scale = scale();
    let h = scale * (here.h + prior.information) * scale;
    let g = scale * (here.g + prior.information * offset);
    let eigen = h.symmetric_eigen();
    let least = ratio * eigen.eigenvalues.max();
    let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
    let observed = directions.filter(|(value, _)| **value > least.max(f64::MIN_POSITIVE));
    let step: Vector3<f64> = observed.map(|(value, v)| -v * (v.dot(&g) / value)).sum();
    let step = scale * step;
    step.iter().all(|v| v.is_finite()).then_some(step)
}

/// Yaw in metres at [`ARM_M`].
pub(crate) fn scale() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / ARM_M))
}

/// The direction that is hardly observed, if there is one.
pub(crate) fn weak_axis(h: &Matrix3<f64>, ratio: f64) -> Option<Vector3<f64>> {
    let scale = scale();
    let eigen = (scale * h * scale).symmetric_eigen();
    let weakest = eigen.eigenvalues.imin();
    let axis = scale * eigen.eigenvectors.column(weakest);
    (eigen.eigenvalues[weakest] < ratio * eigen.eigenvalues.max()).then(|| axis.normalize())
}
