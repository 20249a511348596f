use super::pairing::Pair;
use super::{WsmCovariance, WsmSettings};
use geometry::{Matrix2, Matrix3, Pose2, Vector2, Vector3};
use nalgebra::Matrix2x3;

/// What the pairs say about the pose, as right perturbation in the scan's frame.
pub(crate) struct Information {
    /// How fast the estimator's gradient answers to a displacement.
    sensitivity: Matrix3<f64>,
    /// Covariance of the gradient.
    spread: Matrix3<f64>,
    /// Mean squared distance of the scan points from the scan's origin, m^2.
    arm_squared: f64,
}

impl Information {
    /// Accumulates the pairs at a pose. The derivation is in docs/math/wsm.md, "An honest
    /// covariance".
    pub fn of(pairs: &[Pair<'_>], pose: &Pose2, settings: &WsmSettings) -> Self {
        let (s, c) = pose.yaw.sin_cos();
        let r = Matrix2::new(c, -s, s, c);
        let mut information = Information {
            sensitivity: Matrix3::zeros(),
            spread: Matrix3::zeros(),
            arm_squared: 0.0,
        };
        for pair in pairs {
            let Some(used) = pair.weighted_at(&r, pose.translation(), 0.0, settings) else {
                continue;
            };
            let w = r.transpose() * used.weight * r;
            let b = pair.scan.position;
            let jacobian = Matrix2x3::new(1.0, 0.0, -b.y, 0.0, 1.0, b.x);
            let (answer, spread) = match settings.covariance {
                WsmCovariance::Pairs => (w, w),
                WsmCovariance::Sandwich => {
                    let truth = pair.covariance(&r, 1.0, settings.one_sided);
                    let answer = observable(pair, &w, &r);
                    (answer, w * r.transpose() * truth * r * w)
                }
            };
            information.sensitivity += jacobian.transpose() * answer * jacobian;
            information.spread += jacobian.transpose() * spread * jacobian;
            information.arm_squared += b.norm_squared() / pairs.len() as f64;
        }
        information
    }

    /// Covariance `A^-1 B A^-1`, and the weak axis if the weakest direction's sensitivity is below
    /// `ratio` of the strongest's, with yaw measured at the mean distance of the points.
    pub fn covariance(&self, ratio: f64) -> (Matrix3<f64>, Option<Vector3<f64>>) {
        let arm = self.arm_squared.sqrt().max(1e-3);
        let scale = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / arm));
        let eigen = (scale * self.sensitivity * scale).symmetric_eigen();
        let strongest = eigen.eigenvalues.max().max(1e-12);
        let floor = 1e-6 * strongest;
        let inverse = eigen.eigenvalues.map(|v| 1.0 / v.max(floor));
        let inverse =
            eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
        let inverse = scale * inverse * scale;
        let covariance = inverse * self.spread * inverse;
        // An open direction keeps a large variance even where its gradient happens to be quiet.
        let weakest = eigen.eigenvalues.imin();
        let axis = scale * eigen.eigenvectors.column(weakest);
        let degenerate = eigen.eigenvalues[weakest] < ratio * strongest;
        let open = if eigen.eigenvalues[weakest] < floor {
            axis * axis.transpose() / floor
        } else {
            Matrix3::zeros()
        };
        (0.5 * (covariance + covariance.transpose()) + open, degenerate.then(|| axis.normalize()))
    }
}

/// The share of a pair's weight that answers to a displacement, in the scan's frame: across the
/// surface, since along it the nearest neighbour slides with the estimate; less what the error of
/// the surface's direction pretends.
fn observable(pair: &Pair<'_>, w: &Matrix2<f64>, r: &Matrix2<f64>) -> Matrix2<f64> {
    let Some(line) = pair.surface(r) else { return *w };
    let normal = r.transpose() * line.normal;
    let tangent = Vector2::new(-normal.y, normal.x);
    let across = normal.dot(&(w * normal));
    (normal * normal.transpose() - tangent * tangent.transpose() * line.variance) * across
}
