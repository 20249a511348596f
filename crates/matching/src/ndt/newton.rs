use crate::Prior;
use crate::closest::{ARM_M, scale};
use crate::fast::turn;
use geometry::{Matrix3, Pose2, Vector3, wrap_angle};

/// A cost at a pose with its gradient and Hessian by `(x, y, yaw)` in the reference frame.
#[derive(Clone, Copy, Default)]
pub(super) struct Cost {
    pub value: f64,
    pub g: Vector3<f64>,
    pub h: Matrix3<f64>,
    /// What of a displacement surfaces tell, in points.
    pub observed: Matrix3<f64>,
}

impl Cost {
    /// The same with a prior, `(x - x_0)^T P (x - x_0) / 2`.
    fn with_prior(mut self, pose: &Pose2, prior: &Prior) -> Self {
        let turn = turn(&prior.pose);
        let information = turn * prior.information * turn.transpose();
        let offset = Vector3::new(
            pose.x - prior.pose.x,
            pose.y - prior.pose.y,
            wrap_angle(pose.yaw - prior.pose.yaw),
        );
        self.value += 0.5 * offset.dot(&(information * offset));
        self.g += information * offset;
        self.h += information;
        self.observed += information;
        self
    }
}

/// Where a climb ended.
pub(super) struct Summit {
    pub pose: Pose2,
    /// The cost there.
    pub value: f64,
    pub iterations: u32,
    /// Whether steps became shorter than asked for.
    pub settled: bool,
}

/// When to end a climb.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub max_iterations: u32,
    /// A step shorter than this, metres (radians at 5 m), is the last.
    pub step_m: f64,
    /// Directions observed less than this share of the best stand still.
    pub ratio: f64,
}

/// Newton's method with damping until the cost falls (Levenberg and Marquardt).
pub(super) fn climb(
    cost: impl Fn(&Pose2) -> Cost,
    start: Pose2,
    prior: &Prior,
    limits: &Limits,
) -> Summit {
    let cost = |pose: &Pose2| cost(pose).with_prior(pose, prior);
    let mut pose = start;
    let mut here = cost(&pose);
    let mut damping = 1e-3;
    for iterations in 0..limits.max_iterations {
        let scale = here.h.diagonal().abs().max().max(1e-9);
        let damping_matrix = scale_of_yaw() * (damping * scale);
        let step = damped_step(&here, &damping_matrix, limits.ratio);
        let Some(step) = step.filter(|s| s.iter().all(|v| v.is_finite())) else {
            damping *= 10.0;
            continue;
        };
        let length = step.xy().norm().max(ARM_M * step.z.abs());
        if length < limits.step_m {
            return Summit { pose, value: here.value, iterations, settled: true };
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
    Summit { pose, value: here.value, iterations: limits.max_iterations, settled: false }
}

/// A step along what is observed; what little pulls along a corridor is noise (Zhang, Kaess, Singh,
/// "On degeneracy of optimization-based state estimation problems", ICRA 2016).
fn damped_step(here: &Cost, damping: &Matrix3<f64>, ratio: f64) -> Option<Vector3<f64>> {
    let scale = scale();
    let damped = scale * (here.h + damping) * scale;
    let g = scale * here.g;
    let eigen = (scale * here.observed * scale).symmetric_eigen();
    let least = ratio * eigen.eigenvalues.max();
    let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
    let still = directions.filter(|(value, _)| **value <= least);
    let still: Matrix3<f64> = still.map(|(_, v)| v * v.transpose()).sum();
    let free = Matrix3::identity() - still;
    let damped = free * damped * free + still * damped.trace().abs();
    damped.cholesky().map(|factor| scale * (free * -factor.solve(&(free * g))))
}

/// Damping by metres, a radian at [`ARM_M`].
fn scale_of_yaw() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, ARM_M * ARM_M))
}
