use super::{ClosestPair, Linearisation, pairs::slid};
use geometry::{Matrix2, Matrix3, Pose2, Vector2, Vector3};
use std::collections::BTreeMap;

/// How errors of the ranges become an error of the pose: `A^-1 (sum s^2 d d^T) A^-1` with `A` the
/// answer of the cost's gradient to a displacement and `d` its derivative by one range (Censi, "An
/// accurate closed-form estimate of ICP's covariance", ICRA 2007). A range that several pairs share
/// counts once, with all of them. Both count only what a weight has across the surface, see
/// [`across`].
pub(crate) struct RangeErrors {
    /// Standard deviation of a range, metres.
    pub range_std_m: f64,
}

impl RangeErrors {
    /// Covariance of the pose as a right perturbation in the scan's frame; `None` without pairs.
    pub fn covariance(&self, here: &Linearisation, pose: &Pose2) -> Option<Matrix3<f64>> {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let mut by_range: BTreeMap<(bool, usize), Vector3<f64>> = BTreeMap::new();
        let (mut answer, mut directions) = (Matrix3::zeros(), Matrix3::zeros());
        for pair in &here.pairs {
            let jacobian = pair.jacobian(&rotation);
            let weighted = jacobian.transpose() * across(pair, &pair.weight);
            answer += weighted * jacobian;
            *by_range.entry((false, pair.scan_index)).or_default() +=
                weighted * rotation * pair.scan.ray;
            *by_range.entry((true, pair.reference_index)).or_default() -=
                weighted * pair.reference.ray;
            let leak = weighted * leaking(pair);
            let drag = jacobian.transpose() * pair.weight * dragging(pair);
            directions += leak * leak.transpose() + drag * drag.transpose();
        }
        let ranges: Matrix3<f64> = by_range.values().map(|d| d * d.transpose()).sum();
        let spread = ranges * self.range_std_m.powi(2) + directions;
        sandwich(&answer, &spread)
    }
}

/// Covariance of a point-to-point match as a right perturbation in the scan's frame: `A^-1 B A^-1`
/// with `B` the spread of the gradient as the residuals show it. `A` is how the gradient answers to
/// a displacement: across surfaces only, since along them the closest point slides with the
/// estimate (Bonnabel, Barczyk, Goulette, ACC 2016), which is why `H^-1` promises far too much.
pub(crate) fn sliding_covariance(here: &Linearisation, pose: &Pose2) -> Option<Matrix3<f64>> {
    let (sin, cos) = pose.yaw.sin_cos();
    let rotation = Matrix2::new(cos, -sin, sin, cos);
    let (mut answer, mut spread) = (Matrix3::zeros(), Matrix3::zeros());
    for pair in &here.pairs {
        let jacobian = pair.jacobian(&rotation);
        answer += jacobian.transpose() * across(pair, &Matrix2::identity()) * jacobian;
        let gradient = jacobian.transpose() * pair.residual;
        spread += gradient * gradient.transpose();
    }
    sandwich(&answer, &spread)
}

/// How the gradient answers to a displacement in the scan's frame: across surfaces only. What it
/// leaves open no covariance should claim, and no status.
pub(crate) fn answer(here: &Linearisation, pose: &Pose2) -> Matrix3<f64> {
    let (sin, cos) = pose.yaw.sin_cos();
    let rotation = Matrix2::new(cos, -sin, sin, cos);
    let one = |pair: &ClosestPair| {
        let jacobian = pair.jacobian(&rotation);
        jacobian.transpose() * across(pair, &pair.weight) * jacobian
    };
    here.pairs.iter().map(one).sum()
}

/// What of a pair's weight answers to a displacement: that across the reference's surface, since
/// along it the closest point slides with the estimate. Where the surface is not known, the segment
/// tells; all of it counts on points without either.
fn across(pair: &ClosestPair, weight: &Matrix2<f64>) -> Matrix2<f64> {
    match pair.reference.normal {
        Some(normal) => normal * normal.transpose() * normal.dot(&(weight * normal)),
        None => slid(weight, pair.along),
    }
}

fn sandwich(answer: &Matrix3<f64>, spread: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let inverse = regularised(answer)?;
    let covariance = inverse * spread * inverse;
    Some(0.5 * (covariance + covariance.transpose()))
}

/// What an error of the reference's direction makes of the distance along the surface: the two
/// points of a pair lie apart along it, by as much as they were sampled.
fn leaking(pair: &ClosestPair) -> Vector2<f64> {
    let Some(normal) = pair.reference.normal else { return Vector2::zeros() };
    normal * dragging(pair).norm() * pair.reference.normal_variance.max(0.0).sqrt()
}

/// The part of a residual along the surface: what pulls that way, where a weight lets it, is noise.
fn dragging(pair: &ClosestPair) -> Vector2<f64> {
    let Some(normal) = pair.reference.normal else { return Vector2::zeros() };
    pair.residual - normal * normal.dot(&pair.residual)
}

/// The inverse of an information; open directions are taken for known to 1e-9 of the best.
fn regularised(h: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let scale = h.diagonal().max();
    (h + Matrix3::identity() * (1e-9 * scale)).try_inverse()
}
