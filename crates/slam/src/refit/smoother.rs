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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A winding chain whose measurements are off by centimetres (`noise` 1), with motions that are
    /// right; every third pose is measured well, the others hardly.
    fn chain(poses: usize, noise: f64) -> (Vec<Pose2>, Vec<Knowledge>) {
        let step = Pose2::new(0.4, 0.05, 0.3);
        let truth: Vec<Pose2> =
            std::iter::successors(Some(Pose2::new(1.0, 2.0, 0.5)), |p| Some(*p * step))
                .take(poses)
                .collect();
        let knowledge = truth.iter().enumerate().map(|(i, pose)| {
            let wave = |k: f64| noise * (k * (i as f64 + 1.0)).sin();
            let error = Vector3::new(0.03 * wave(1.7), 0.03 * wave(2.9), 0.01 * wave(4.1));
            let weight = if i % 3 == 0 { 1e4 } else { 10.0 };
            let motion = GaussianPose2 {
                mean: step,
                covariance: Matrix3::from_diagonal(&Vector3::new(4e-4, 1e-4, 1e-4)),
            };
            Knowledge {
                measured: pose.retract(&error),
                information: Matrix3::from_diagonal(&Vector3::new(weight, 2.0 * weight, weight)),
                motion: (i > 0).then_some(motion),
            }
        });
        let knowledge = knowledge.collect();
        (truth, knowledge)
    }

    /// All whitened residuals of a trajectory, without robust weights.
    fn residuals(knowledge: &[Knowledge], poses: &[Pose2]) -> DVector<f64> {
        let mut all = Vec::new();
        for (i, (k, pose)) in knowledge.iter().zip(poses).enumerate() {
            let root = k.information.map(f64::sqrt);
            all.extend((root * k.measured.between(pose).log()).iter());
            if let Some(motion) = k.motion {
                let residual = motion.mean.between(&poses[i - 1].between(pose)).log();
                all.extend(
                    (motion
                        .covariance
                        .map(|v| v.sqrt().recip().min(1e9))
                        .component_mul(&Matrix3::identity())
                        * residual)
                        .iter(),
                );
            }
        }
        DVector::from_vec(all)
    }

    /// Gauss-Newton with numeric derivatives and dense least squares.
    fn smooth_densely(knowledge: &[Knowledge]) -> Vec<Pose2> {
        let mut poses: Vec<Pose2> = knowledge.iter().map(|k| k.measured).collect();
        for _ in 0..20 {
            let columns: Vec<DVector<f64>> = (0..3 * poses.len())
                .map(|index| {
                    let moved = |h: f64| {
                        let mut poses = poses.clone();
                        let mut step = Vector3::zeros();
                        step[index % 3] = h;
                        poses[index / 3] = poses[index / 3].retract(&step);
                        residuals(knowledge, &poses)
                    };
                    (moved(1e-6) - moved(-1e-6)) / 2e-6
                })
                .collect();
            let jacobian = DMatrix::from_columns(&columns);
            let right = -(jacobian.transpose() * residuals(knowledge, &poses));
            let normal = jacobian.transpose() * &jacobian;
            let step = normal.cholesky().expect("every pose is measured").solve(&right);
            for (i, pose) in poses.iter_mut().enumerate() {
                *pose = pose.retract(&Vector3::new(step[3 * i], step[3 * i + 1], step[3 * i + 2]));
            }
        }
        poses
    }

    fn farthest(a: &[Pose2], b: &[Pose2]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a.between(b).log().norm()).fold(0.0, f64::max)
    }

    #[test]
    fn the_chain_is_solved_as_densely() {
        let (truth, knowledge) = chain(14, 1.0);
        // A kernel this wide weighs nothing down.
        let smoothed = smooth(&knowledge, 1e9, 20);
        let dense = smooth_densely(&knowledge);
        let apart = farthest(&smoothed, &dense);
        assert!(apart < 1e-3, "{apart}");
        let measured: Vec<Pose2> = knowledge.iter().map(|k| k.measured).collect();
        assert!(apart < 0.05 * farthest(&measured, &dense), "nothing was smoothed");
        assert!(farthest(&smoothed, &truth) < farthest(&measured, &truth));
    }

    #[test]
    fn exact_knowledge_stays_exact() {
        let (truth, knowledge) = chain(30, 0.0);
        assert!(farthest(&smooth(&knowledge, 3.0, 5), &truth) < 1e-12);
        assert!(smooth(&[], 3.0, 5).is_empty());
    }

    /// A motion that contradicts the map moves even badly measured poses by little.
    #[test]
    fn a_wrong_motion_is_weighed_down() {
        let (truth, mut knowledge) = chain(12, 0.0);
        knowledge[6].motion = None;
        if let Some(motion) = &mut knowledge[4].motion {
            motion.mean = motion.mean * Pose2::new(3.0, 0.0, 1.0);
        }
        let robust = farthest(&smooth(&knowledge, 3.0, 10), &truth);
        let plain = farthest(&smooth(&knowledge, 1e9, 10), &truth);
        assert!(robust < 0.2 && robust < 0.1 * plain, "{robust} {plain}");
    }
}
