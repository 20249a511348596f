use geometry::{GaussianPose2, LieGroup, Matrix3, Pose2, Vector3};

/// What is known of one pose of a trajectory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Knowledge {
    /// The pose measured against the map, and its information (zero: nothing measured), as a right
    /// perturbation.
    pub measured: Pose2,
    pub information: Matrix3<f64>,
    /// The motion from the pose before to this one; `None` where odometry is missing.
    pub motion: Option<GaussianPose2>,
}

/// The most likely trajectory given measurements of single poses and of the motions between them.
///
/// Gauss-Newton on the chain; its normal equations are block tridiagonal and are solved by block
/// elimination forwards and substitution backwards, in time linear in the number of poses. Motions
/// that contradict the map are weighted down (Cauchy kernel of scale `outlier_sigmas`).
pub(crate) fn smooth(
    knowledge: &[Knowledge],
    outlier_sigmas: f64,
    iterations: usize,
) -> Vec<Pose2> {
    let mut poses: Vec<Pose2> = knowledge.iter().map(|k| k.measured).collect();
    for _ in 0..iterations {
        let steps = solve_chain(&linearise(knowledge, &poses, outlier_sigmas));
        for (pose, step) in poses.iter_mut().zip(&steps) {
            *pose = pose.retract(step);
        }
    }
    poses
}

/// One row of the block tridiagonal system: `lower x[i-1] + diagonal x[i] + lower(i+1)^T x[i+1] =
/// right`.
#[derive(Clone, Copy, Debug)]
struct Row {
    lower: Matrix3<f64>,
    diagonal: Matrix3<f64>,
    right: Vector3<f64>,
}

fn linearise(knowledge: &[Knowledge], poses: &[Pose2], outlier_sigmas: f64) -> Vec<Row> {
    let mut rows: Vec<Row> = knowledge
        .iter()
        .zip(poses)
        .map(|(k, pose)| Row {
            lower: Matrix3::zeros(),
            diagonal: k.information + Matrix3::identity() * 1e-6,
            right: -(k.information * k.measured.between(pose).log()),
        })
        .collect();
    for i in 1..knowledge.len() {
        let Some(motion) = knowledge[i].motion else { continue };
        let Some(information) = motion.covariance.try_inverse() else { continue };
        let predicted = poses[i - 1].between(&poses[i]);
        let residual = motion.mean.between(&predicted).log();
        let distance2 = (residual.transpose() * information * residual).x;
        let w = information / (1.0 + distance2 / (outlier_sigmas * outlier_sigmas));
        // d residual / d step[i] is close to the identity, d residual / d step[i-1] to
        // -Ad(predicted^-1).
        let j = -predicted.inverse().adjoint();
        rows[i].diagonal += w;
        rows[i].right -= w * residual;
        rows[i].lower += w * j;
        rows[i - 1].diagonal += j.transpose() * w * j;
        rows[i - 1].right -= j.transpose() * w * residual;
    }
    rows
}

fn solve_chain(rows: &[Row]) -> Vec<Vector3<f64>> {
    let n = rows.len();
    let mut inverse = vec![Matrix3::zeros(); n];
    let mut right = vec![Vector3::zeros(); n];
    for i in 0..n {
        let (mut d, mut r) = (rows[i].diagonal, rows[i].right);
        if i > 0 {
            let factor = rows[i].lower * inverse[i - 1];
            d -= factor * rows[i].lower.transpose();
            r -= factor * right[i - 1];
        }
        inverse[i] = d.try_inverse().unwrap_or_else(Matrix3::zeros);
        right[i] = r;
    }
    let mut steps = vec![Vector3::zeros(); n];
    for i in (0..n).rev() {
        let mut r = right[i];
        if i + 1 < n {
            r -= rows[i + 1].lower.transpose() * steps[i + 1];
        }
        steps[i] = inverse[i] * r;
    }
    steps
}
