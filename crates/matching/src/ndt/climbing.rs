use super::distribution::Shape;
use super::newton::{Cost, Limits, Summit, climb};
use super::{Doubt, NdtSettings, Score};
use crate::closest::{scale, weak_axis};
use crate::fast::turn;
use crate::{MatchResult, MatchStatus, PointCloud, Prior};
use geometry::{LieGroup, Matrix3, Pose2, wrap_angle};

/// One resolution.
pub(super) struct Level {
    side_m: f64,
    flatness: f64,
    pub coarsest: bool,
}

impl Level {
    pub fn shape(&self, s: &NdtSettings, endless: bool) -> Shape {
        let Level { side_m, flatness, .. } = *self;
        Shape { side_m, flatness, min_points: s.min_points, endless, doublings: s.doublings }
    }
}

/// Factor on the last step's length at all resolutions but the last.
const UNFINISHED: f64 = 10.0;

/// Variance of a direction that nothing tells of, square metres.
const OPEN_M2: f64 = 100.0;

/// Climbs from large cells to small ones.
pub(super) fn align<S: Score>(
    s: &NdtSettings,
    scan: &PointCloud,
    prior: &Prior,
    score: impl Fn(&Level) -> S,
) -> MatchResult {
    let levels = levels(s);
    let limits =
        Limits { max_iterations: s.max_iterations, step_m: s.step_m, ratio: s.degenerate_ratio };
    let (mut pose, mut iterations, mut settled) = (prior.pose, 0, false);
    let mut last = None;
    for (index, level) in levels.iter().enumerate() {
        let score = score(level);
        // Smaller cells do the rest.
        let rest = if index + 1 < levels.len() { UNFINISHED } else { 1.0 };
        let limits = Limits { step_m: rest * limits.step_m, ..limits };
        let summit = if level.coarsest {
            highest(s, &score, prior, &limits)
        } else {
            climb(|pose| score.cost(pose), pose, prior, &limits)
        };
        (pose, settled) = (summit.pose, summit.settled);
        iterations += summit.iterations;
        last = Some(score);
    }
    let Some((here, doubt)) = last.map(|score| (score.cost(&pose), score.doubt(&pose))) else {
        return MatchResult::failed(prior.pose, iterations, MatchStatus::TooFewPoints);
    };
    if doubt.explained < 6 || scan.len() < 6 {
        return MatchResult::failed(prior.pose, iterations, MatchStatus::TooFewPoints);
    }
    let inlier_ratio = doubt.explained as f64 / scan.len() as f64;
    let turned = wrap_angle(pose.yaw - prior.pose.yaw).abs();
    let left = pose.distance(&prior.pose) > s.max_shift_m || turned > s.max_turn_rad;
    if !settled || !pose.is_finite() || left || inlier_ratio < s.min_inlier_ratio {
        return MatchResult::failed(prior.pose, iterations, MatchStatus::Diverged);
    }
    conclude((&here, &doubt), pose, iterations, inlier_ratio, s)
}

/// The resolutions, largest cells first.
fn levels(s: &NdtSettings) -> Vec<Level> {
    let resolutions = s.resolutions.clamp(1, 10);
    let level = |resolution: u32| {
        let finer = (resolutions - 1 - resolution) as i32;
        Level {
            side_m: s.coarsest_m * 0.5f64.powi(resolution as i32),
            flatness: (s.flatness * s.widening.powi(finer)).min(1.0),
            coarsest: resolution == 0 && finer > 0,
        }
    };
    (0..resolutions).map(level).collect()
}

/// Climbs from the prior's pose and, where that leads to no good fit, from turned ones: the best.
fn highest<S: Score>(s: &NdtSettings, score: &S, prior: &Prior, limits: &Limits) -> Summit {
    let from = |yaw: f64| {
        let start = Pose2::new(prior.pose.x, prior.pose.y, prior.pose.yaw + yaw);
        climb(|pose| score.cost(pose), start, prior, limits)
    };
    let mut best = from(0.0);
    if best.value < -4.0 * s.good_fit * score.weight() {
        return best;
    }
    let mut iterations = best.iterations;
    for turn in 1..=s.turned_starts.min(20) {
        for sign in [1.0, -1.0] {
            let other = from(sign * f64::from(turn) * s.start_step_rad);
            iterations += other.iterations;
            if other.value < best.value {
                best = other;
            }
        }
    }
    Summit { iterations, ..best }
}

/// Covariance `H^-1 spread H^-1`, in the scan's frame.
fn conclude(
    (here, doubt): (&Cost, &Doubt),
    pose: Pose2,
    iterations: u32,
    inlier_ratio: f64,
    s: &NdtSettings,
) -> MatchResult {
    let turn = turn(&pose);
    let [h, spread, observed] =
        [&here.h, &doubt.spread, &here.observed].map(|m| turn.transpose() * m * turn);
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
    let covariance = 0.5 * (covariance + covariance.transpose());
    let (status, open) = match weak_axis(&observed, s.degenerate_ratio) {
        Some(weak_axis) => {
            let open = weak_axis * weak_axis.transpose() * OPEN_M2;
            (MatchStatus::Degenerate { weak_axis }, open)
        }
        None => (MatchStatus::Converged, Matrix3::zeros()),
    };
    MatchResult { pose, covariance: covariance + open, inlier_ratio, iterations, status }
}
