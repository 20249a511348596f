use geometry::{Pose2, Vector2};

/// Absolute trajectory error: root mean square distance of the positions of an estimate from the
/// true ones, metres, after the rigid motion that makes it least (Umeyama 1991, in the plane and
/// without scale). Poses in the same order; those of the longer list that have no partner count
/// for nothing. Not a number where there are none.
pub fn trajectory_error(truth: &[Pose2], estimate: &[Pose2]) -> f64 {
    let n = truth.len().min(estimate.len());
    let (truth, estimate) = (&truth[..n], &estimate[..n]);
    let mean =
        |poses: &[Pose2]| poses.iter().map(Pose2::translation).sum::<Vector2<f64>>() / n as f64;
    let (to, from) = (mean(truth), mean(estimate));
    let pairs = || {
        let pairs = truth.iter().zip(estimate);
        pairs.map(|(t, e)| (e.translation() - from, t.translation() - to))
    };
    let (cos, sin) =
        pairs().fold((0.0, 0.0), |(cos, sin), (e, t)| (cos + e.dot(&t), sin + e.perp(&t)));
    let turn = Pose2::new(0.0, 0.0, f64::atan2(sin, cos));
    let squares = pairs().map(|(e, t)| (turn.transform(e) - t).norm_squared());
    (squares.sum::<f64>() / n as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_no_error_and_one_stray_pose_is() {
        let truth = [(0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (-1.0, 1.0)];
        let truth = truth.map(|(x, y)| Pose2::new(x, y, 0.3));
        let moved = truth.map(|pose| Pose2::new(5.0, -7.0, 2.0) * pose);
        assert!(trajectory_error(&truth, &moved) < 1e-12);
        let line = [-1.0, 1.0, 1.0, -1.0].map(|x| Pose2::new(x, 0.0, 0.0));
        let off = [(-1.0, 0.1), (1.0, 0.1), (1.0, -0.1), (-1.0, -0.1)];
        let off = off.map(|(x, y)| Pose2::new(x, y, 0.0));
        assert!((trajectory_error(&line, &off) - 0.1).abs() < 1e-12);
        assert!(trajectory_error(&[], &[]).is_nan());
    }
}
