//! How good a trajectory is. Pure functions; the formulas are those of the benchmark's own scripts.

use geometry::{Pose2, Vector2, wrap_angle};
use logs::{TrueRelation, TumPose};
use serde::Serialize;
use std::collections::HashMap;

/// A trajectory by stamp. Stamps match within 0.1 ms; of equal stamps the first counts.
pub struct StampedPoses(HashMap<i64, Pose2>);

impl StampedPoses {
    /// From stamps in seconds.
    pub fn new(poses: impl IntoIterator<Item = (f64, Pose2)>) -> Self {
        let mut map = HashMap::new();
        for (secs, pose) in poses {
            map.entry(key(secs)).or_insert(pose);
        }
        StampedPoses(map)
    }

    /// From a TUM file's lines.
    pub fn of_tum(poses: &[TumPose]) -> Self {
        // The reader has made sure that stamps are numbers.
        let secs = |p: &TumPose| p.stamp_text.parse().unwrap_or(f64::NAN);
        Self::new(poses.iter().map(|p| (secs(p), p.pose)))
    }

    /// The pose at a stamp.
    pub fn at(&self, secs: f64) -> Option<Pose2> {
        [0, -1, 1].iter().find_map(|d| self.0.get(&(key(secs) + d)).copied())
    }
}

fn key(secs: f64) -> i64 {
    (secs * 1e4).round_ties_even() as i64
}

/// Errors against true relations; standard deviations are those of the population.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RelationScore {
    /// Relations with both stamps in the trajectory.
    pub used: usize,
    /// All relations.
    pub total: usize,
    /// Mean translational error, metres.
    pub trans_mean_m: f64,
    /// Its standard deviation.
    pub trans_std_m: f64,
    /// Mean rotational error, degrees.
    pub rot_mean_deg: f64,
    /// Its standard deviation.
    pub rot_std_deg: f64,
    /// Mean squared translational error, m^2.
    pub trans_sq_mean: f64,
    /// Its standard deviation.
    pub trans_sq_std: f64,
    /// Mean squared rotational error, deg^2.
    pub rot_sq_mean: f64,
    /// Its standard deviation.
    pub rot_sq_std: f64,
    /// Median translational error, metres.
    pub trans_median_m: f64,
    /// 95th percentile of the translational error, metres.
    pub trans_p95_m: f64,
}

impl RelationScore {
    /// Scores a trajectory: the error of a relation is `truth^-1 * estimate`. `None` when no
    /// relation has both its stamps in the trajectory.
    pub fn new(truth: &[TrueRelation], poses: &StampedPoses) -> Option<Self> {
        let error = |relation: &TrueRelation| {
            Some(relation_error(
                relation,
                poses.at(relation.from_secs)?,
                poses.at(relation.to_secs)?,
            ))
        };
        let errors: Vec<Pose2> = truth.iter().filter_map(error).collect();
        Self::of_errors(&errors, errors.len(), truth.len())
    }

    /// Scores errors of relations, of which `used` of `total` have any; `None` without errors.
    pub fn of_errors(errors: &[Pose2], used: usize, total: usize) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let mut trans: Vec<f64> = errors.iter().map(Pose2::norm).collect();
        let rot: Vec<f64> = errors.iter().map(|e| e.yaw.abs().to_degrees()).collect();
        let squares = |v: &[f64]| mean_and_std(&v.iter().map(|x| x * x).collect::<Vec<_>>());
        let ((trans_mean_m, trans_std_m), (rot_mean_deg, rot_std_deg)) =
            (mean_and_std(&trans), mean_and_std(&rot));
        let ((trans_sq_mean, trans_sq_std), (rot_sq_mean, rot_sq_std)) =
            (squares(&trans), squares(&rot));
        trans.sort_by(f64::total_cmp);
        Some(RelationScore {
            used,
            total,
            trans_mean_m,
            trans_std_m,
            rot_mean_deg,
            rot_std_deg,
            trans_sq_mean,
            trans_sq_std,
            rot_sq_mean,
            rot_sq_std,
            trans_median_m: trans[trans.len() / 2],
            trans_p95_m: trans[(0.95 * (trans.len() - 1) as f64) as usize],
        })
    }

    /// One line for people.
    pub fn to_line(self) -> String {
        format!(
            "used {}/{}  trans {:.4} +- {:.4} m  rot {:.3} +- {:.3} deg  trans^2 {:.4} +- {:.4}  \
             rot^2 {:.3} +- {:.3}  median {:.4} m  p95 {:.4} m",
            self.used,
            self.total,
            self.trans_mean_m,
            self.trans_std_m,
            self.rot_mean_deg,
            self.rot_std_deg,
            self.trans_sq_mean,
            self.trans_sq_std,
            self.rot_sq_mean,
            self.rot_sq_std,
            self.trans_median_m,
            self.trans_p95_m,
        )
    }
}

/// The error of an estimated relation, as the benchmark has it: what is left of the coordinates.
pub fn relation_error(relation: &TrueRelation, from: Pose2, to: Pose2) -> Pose2 {
    let (estimate, truth) = (from.between(&to), relation.from_from_to);
    let yaw = wrap_angle(estimate.yaw - truth.yaw);
    Pose2::new(estimate.x - truth.x, estimate.y - truth.y, yaw)
}

fn mean_and_std(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt())
}

/// Absolute trajectory error: distances and turns that remain after the best rigid alignment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AteScore {
    /// Poses compared.
    pub poses: usize,
    /// Root mean square distance, metres.
    pub trans_rmse_m: f64,
    /// Mean distance, metres.
    pub trans_mean_m: f64,
    /// Median distance, metres.
    pub trans_median_m: f64,
    /// Largest distance, metres.
    pub trans_max_m: f64,
    /// Root mean square turn, degrees.
    pub rot_rmse_deg: f64,
    /// The alignment, `truth_from_estimate`.
    pub alignment: Pose2,
}

impl AteScore {
    /// Compares pairs of true and estimated poses; `None` without any.
    pub fn new(pairs: &[(Pose2, Pose2)]) -> Option<Self> {
        let alignment = align(pairs)?;
        let mut distances = Vec::with_capacity(pairs.len());
        let mut turns = 0.0;
        for (truth, estimate) in pairs {
            let aligned = alignment * *estimate;
            distances.push(truth.distance(&aligned));
            turns += wrap_angle(aligned.yaw - truth.yaw).to_degrees().powi(2);
        }
        distances.sort_by(f64::total_cmp);
        let n = distances.len() as f64;
        Some(AteScore {
            poses: distances.len(),
            trans_rmse_m: (distances.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
            trans_mean_m: distances.iter().sum::<f64>() / n,
            trans_median_m: distances[distances.len() / 2],
            trans_max_m: distances[distances.len() - 1],
            rot_rmse_deg: (turns / n).sqrt(),
            alignment,
        })
    }

    /// One line for people.
    pub fn to_line(self) -> String {
        format!(
            "{} poses  trans rmse {:.4} m  mean {:.4} m  median {:.4} m  max {:.4} m  rot rmse {:.3} deg",
            self.poses,
            self.trans_rmse_m,
            self.trans_mean_m,
            self.trans_median_m,
            self.trans_max_m,
            self.rot_rmse_deg,
        )
    }
}

/// The rigid transform `truth_from_estimate` with the least squared distances between positions
/// (Umeyama 1991, without scale; in the plane the rotation is an arc tangent).
fn align(pairs: &[(Pose2, Pose2)]) -> Option<Pose2> {
    if pairs.is_empty() {
        return None;
    }
    let n = pairs.len() as f64;
    let sum = |pick: fn(&(Pose2, Pose2)) -> Pose2| {
        pairs.iter().map(|p| pick(p).translation()).fold(Vector2::zeros(), |a, b| a + b) / n
    };
    let (truth_mean, estimate_mean) = (sum(|p| p.0), sum(|p| p.1));
    let (mut cos, mut sin) = (0.0, 0.0);
    for (truth, estimate) in pairs {
        let t = truth.translation() - truth_mean;
        let e = estimate.translation() - estimate_mean;
        cos += e.dot(&t);
        sin += e.perp(&t);
    }
    let rotation = Pose2::new(0.0, 0.0, sin.atan2(cos));
    let shift = truth_mean - rotation.transform(estimate_mean);
    Some(Pose2::new(shift.x, shift.y, rotation.yaw))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spiral(count: usize) -> Vec<Pose2> {
        (0..count)
            .map(|i| {
                let t = i as f64 * 0.1;
                Pose2::new(t * t.cos(), t * t.sin(), 1.3 * t)
            })
            .collect()
    }

    #[test]
    fn a_rigid_motion_is_no_error() {
        let truth = spiral(100);
        let moved = Pose2::new(3.0, -7.0, 2.5);
        let pairs: Vec<_> = truth.iter().map(|&p| (p, moved * p)).collect();
        let score = AteScore::new(&pairs).unwrap();
        assert!(score.trans_max_m < 1e-12 && score.rot_rmse_deg < 1e-6);
        assert!(score.alignment.distance(&moved.inverse()) < 1e-12);
        assert_eq!(AteScore::new(&[]), None);
    }

    /// No other rigid motion near the found one does better.
    #[test]
    fn the_alignment_is_the_best() {
        let noisy = |i: usize, p: Pose2| {
            Pose2::new(p.x + (i as f64).sin(), p.y + (2.0 * i as f64).cos(), p.yaw)
        };
        let pairs: Vec<_> =
            spiral(60).into_iter().enumerate().map(|(i, p)| (p, noisy(i, p))).collect();
        let best = align(&pairs).unwrap();
        let cost = |a: Pose2| pairs.iter().map(|(t, e)| t.distance(&(a * *e)).powi(2)).sum::<f64>();
        for (dx, dy, dyaw) in [(1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), (0.0, 0.0, 1e-3)] {
            for sign in [1.0, -1.0] {
                let other =
                    Pose2::new(best.x + sign * dx, best.y + sign * dy, best.yaw + sign * dyaw);
                assert!(cost(other) > cost(best));
            }
        }
    }

    #[test]
    fn known_errors_give_known_scores() {
        let relation = |from: f64, to: f64, x: f64, yaw: f64| TrueRelation {
            from_secs: from,
            to_secs: to,
            from_from_to: Pose2::new(x, 0.0, yaw),
        };
        let poses = StampedPoses::new([
            (1.0, Pose2::new(5.0, 5.0, std::f64::consts::FRAC_PI_2)),
            (2.0, Pose2::new(5.0, 6.0, std::f64::consts::FRAC_PI_2)),
            (2.00001, Pose2::new(99.0, 99.0, 0.0)),
        ]);
        let truth = [
            relation(1.0, 2.0, 1.1, 0.0),
            relation(1.0, 2.0001, 1.3, 0.1),
            relation(1.0, 3.0, 0.0, 0.0),
        ];
        let score = RelationScore::new(&truth, &poses).unwrap();
        assert_eq!((score.used, score.total), (2, 3));
        assert!((score.trans_mean_m - 0.2).abs() < 1e-12);
        assert!((score.trans_std_m - 0.1).abs() < 1e-12);
        assert!((score.rot_mean_deg - 0.05f64.to_degrees()).abs() < 1e-9);
        assert!(RelationScore::new(&truth[2..], &poses).is_none());
    }
}
