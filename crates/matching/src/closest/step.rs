use super::Linearisation;
use crate::Prior;
use geometry::{LieGroup, Matrix3, Pose2, Vector3};

/// Metres that a radian is taken for.
pub(crate) const ARM_M: f64 = 5.0;

/// Length of a step in metres, yaw at [`ARM_M`].
pub(super) fn step_length(step: &Vector3<f64>) -> f64 {
    step.xy().norm().max(ARM_M * step.z.abs())
}

/// One Gauss-Newton step, the prior included. Directions that neither pairs nor prior observe stand
/// still: what little pulls along a corridor is noise (Zhang, Kaess, Singh, "On degeneracy of
/// optimization-based state estimation problems", ICRA 2016).
pub(super) fn solve(
    here: &Linearisation,
    pose: &Pose2,
    prior: &Prior,
    ratio: f64,
) -> Option<Vector3<f64>> {
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
