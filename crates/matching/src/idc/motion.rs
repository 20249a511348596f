use super::view::View;
use crate::closest::Correspondence;
use crate::polyline::Polyline;
use crate::{PointCloud, Prior};
use geometry::{LieGroup, Matrix3, Pose2, Vector2, Vector3};
use nalgebra::Matrix2x3;

/// A scan point and its partner in the reference, both seen from the scan's eye in its frame,
/// metres.
pub(super) type SeenPair = (Vector2<f64>, Vector2<f64>);

/// The closest-point rule: partners on the visible polyline within a gate, the worst dropped.
pub(super) fn closest_pairs(
    polyline: &Polyline<'_>,
    scan: &PointCloud,
    pose: &Pose2,
    eye: Vector2<f64>,
    (gate_m, keep): (f64, f64),
) -> Vec<SeenPair> {
    let inverse = pose.inverse();
    let pair = |b: Vector2<f64>| {
        let partner = polyline.closest(&pose.transform(b), gate_m)?;
        Some((b - eye, inverse.transform(partner.point.position) - eye))
    };
    best(scan.points.iter().filter_map(|p| pair(p.position)).collect(), keep)
}

/// The matching-range rule, the worst pairs dropped.
pub(super) fn range_pairs(
    view: &View,
    scan: &PointCloud,
    eye: Vector2<f64>,
    (window_rad, gate_m, keep): (f64, f64, f64),
) -> Vec<SeenPair> {
    let pair = |b: Vector2<f64>| Some((b, view.same_range(&b, window_rad, gate_m)?));
    best(scan.points.iter().filter_map(|p| pair(p.position - eye)).collect(), keep)
}

/// The share of pairs closest to each other; equal distances stay or go together, so that the order
/// of points does not matter.
fn best(mut pairs: Vec<SeenPair>, keep: f64) -> Vec<SeenPair> {
    let distance2 = |(b, a): &SeenPair| (a - b).norm_squared();
    pairs.retain(|pair| distance2(pair).is_finite());
    let mut distances: Vec<f64> = pairs.iter().map(distance2).collect();
    distances.sort_by(f64::total_cmp);
    let kept = (keep.clamp(0.0, 1.0) * distances.len() as f64) as usize;
    if let Some(&most) = distances.get(kept) {
        pairs.retain(|pair| distance2(pair) <= most);
    }
    pairs
}

/// What a prior says about the next motion, a right perturbation of the present pose.
pub(super) struct PriorPull {
    /// In units of the pairs' information.
    information: Matrix3<f64>,
    /// The present pose as a perturbation of the prior's.
    offset: Vector3<f64>,
}

impl PriorPull {
    /// `pair_information` is what a pair counts for each way, 1/m^2.
    pub fn new(prior: &Prior, pose: &Pose2, pair_information: f64) -> Self {
        let information = prior.information / pair_information;
        PriorPull { information, offset: prior.pose.between(pose).log() }
    }
}

/// The motion that takes the scan points to their partners with the least sum of squares, a right
/// perturbation of the present pose: with means taken off, `w = atan2(sum b x a, sum b . a)` and
/// `T = mean a - R(w) mean b`. A prior is weighed in afterwards, by the information of the pairs.
pub(super) fn motion(pairs: &[SeenPair], eye: Vector2<f64>, prior: &PriorPull) -> Pose2 {
    let n = pairs.len().max(1) as f64;
    let mean_b = pairs.iter().map(|(b, _)| b).sum::<Vector2<f64>>() / n;
    let mean_a = pairs.iter().map(|(_, a)| a).sum::<Vector2<f64>>() / n;
    let (mut cross, mut dot) = (0.0, 0.0);
    for (b, a) in pairs {
        let (b, a) = (b - mean_b, a - mean_a);
        cross += b.perp(&a);
        dot += b.dot(&a);
    }
    let turn = Pose2::new(0.0, 0.0, cross.atan2(dot));
    let free = about(eye, mean_a - turn.rotate(mean_b), turn.yaw);
    if prior.information == Matrix3::zeros() {
        return free;
    }
    let mut h = Matrix3::zeros();
    for (b, _) in pairs {
        let b = b + eye;
        let jacobian = Matrix2x3::new(1.0, 0.0, -b.y, 0.0, 1.0, b.x);
        h += jacobian.transpose() * jacobian;
    }
    let pull = h * free.log() - prior.information * prior.offset;
    let held = (h + prior.information).cholesky().map(|factor| factor.solve(&pull));
    held.map_or(free, |step| Pose2::IDENTITY.retract(&step))
}

/// The translation of one motion and the rotation of another, both as seen from the eye.
pub(super) fn joined(translation: &Pose2, rotation: &Pose2, eye: Vector2<f64>) -> Pose2 {
    about(eye, translation.transform(eye) - eye, rotation.yaw)
}

/// The motion that turns by `yaw` about the eye and then moves by `shift`.
fn about(eye: Vector2<f64>, shift: Vector2<f64>, yaw: f64) -> Pose2 {
    let moved = eye + shift - Pose2::new(0.0, 0.0, yaw).rotate(eye);
    Pose2::new(moved.x, moved.y, yaw)
}
