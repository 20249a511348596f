use crate::{LieGroup, Pose2};
use nalgebra::SMatrix;

/// A Gaussian over poses: `mean * exp(delta)` with `delta ~ N(0, covariance)`.
///
/// The covariance lives in the tangent space of the *source* frame of `mean` (right perturbation),
/// translation first, in m^2, m rad and rad^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<G, const D: usize> {
    /// The mean transform.
    pub mean: G,
    /// Covariance of the right perturbation.
    pub covariance: SMatrix<f64, D, D>,
}

/// A Gaussian over poses in the plane; tangent order `(x, y, yaw)`.
pub type GaussianPose2 = Gaussian<Pose2, 3>;

impl GaussianPose2 {
    /// Variance of the position over both axes, in square metres.
    pub fn position_variance_m2(&self) -> f64 {
        self.covariance[(0, 0)] + self.covariance[(1, 1)]
    }
}

impl<G: LieGroup<D>, const D: usize> Gaussian<G, D> {
    /// A pose known exactly.
    pub fn exact(mean: G) -> Self {
        Gaussian { mean, covariance: SMatrix::zeros() }
    }

    /// First-order composition of two independent Gaussian poses:
    /// `cov = Ad(b^-1) cov_a Ad(b^-1)^T + cov_b`.
    ///
    /// This is how uncertainty grows along a path of relations.
    pub fn compose(&self, other: &Self) -> Self {
        let ad = other.mean.inverse_adjoint();
        Gaussian {
            mean: self.mean.compose(&other.mean),
            covariance: ad * self.covariance * ad.transpose() + other.covariance,
        }
    }

    /// The inverse transform with its covariance, `Ad(a) cov Ad(a)^T`.
    pub fn inverse(&self) -> Self {
        let ad = self.mean.adjoint();
        Gaussian { mean: self.mean.inverse(), covariance: ad * self.covariance * ad.transpose() }
    }

    /// Squared Mahalanobis distance of `pose` from the mean; `None` if the covariance is singular.
    pub fn mahalanobis_squared(&self, pose: &G) -> Option<f64> {
        let delta = self.mean.between(pose).log();
        let information = self.covariance.try_inverse()?;
        Some((delta.transpose() * information * delta).x)
    }
}
