use crate::{LieGroup, Pose2};
use nalgebra::Matrix3;

/// A Gaussian over poses: `mean * exp(delta)` with `delta ~ N(0, covariance)`.
///
/// The covariance lives in the tangent space of the *source* frame of `mean` (right perturbation),
/// order `(x, y, yaw)`, in m^2, m rad and rad^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianPose2 {
    /// The mean transform.
    pub mean: Pose2,
    /// 3x3 covariance of the right perturbation.
    pub covariance: Matrix3<f64>,
}

impl GaussianPose2 {
    /// A pose known exactly.
    pub fn exact(mean: Pose2) -> Self {
        GaussianPose2 { mean, covariance: Matrix3::zeros() }
    }

    /// First-order composition of two independent Gaussian poses:
    /// `cov = Ad(b^-1) cov_a Ad(b^-1)^T + cov_b`.
    ///
    /// This is how uncertainty grows along a path of relations.
    pub fn compose(&self, other: &GaussianPose2) -> GaussianPose2 {
        let ad = other.mean.inverse().adjoint();
        GaussianPose2 {
            mean: self.mean * other.mean,
            covariance: ad * self.covariance * ad.transpose() + other.covariance,
        }
    }

    /// The inverse transform with its covariance, `Ad(a) cov Ad(a)^T`.
    pub fn inverse(&self) -> GaussianPose2 {
        let ad = self.mean.adjoint();
        GaussianPose2 {
            mean: self.mean.inverse(),
            covariance: ad * self.covariance * ad.transpose(),
        }
    }

    /// Squared Mahalanobis distance of `pose` from the mean; `None` if the covariance is singular.
    pub fn mahalanobis_squared(&self, pose: &Pose2) -> Option<f64> {
        let delta = self.mean.between(pose).log();
        let information = self.covariance.try_inverse()?;
        Some((delta.transpose() * information * delta).x)
    }
}
