use nalgebra::{SMatrix, SVector};

/// A matrix Lie group of poses with `D` degrees of freedom: what the optimiser needs to know of
/// SE(2) (`D = 3`) and SE(3) (`D = 6`).
///
/// Tangent vectors are translation first; perturbations act on the right.
/// Reference for the formulas: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation
/// in robotics", 2018.
pub trait LieGroup<const D: usize>: Copy + PartialEq + std::fmt::Debug + Send + Sync {
    /// The neutral element.
    fn identity() -> Self;
    /// `self * other`.
    fn compose(&self, other: &Self) -> Self;
    /// The group inverse.
    fn inverse(&self) -> Self;
    /// The exponential map at the identity.
    fn exp(tangent: &SVector<f64, D>) -> Self;
    /// The logarithm: the inverse of [`LieGroup::exp`].
    fn log(&self) -> SVector<f64, D>;
    /// `Ad` with `self * exp(v) = exp(Ad v) * self`.
    fn adjoint(&self) -> SMatrix<f64, D, D>;
    /// Inverse of the right Jacobian: `log(exp(v) * exp(d)) ~ v + Jr^-1(v) d`.
    fn right_jacobian_inverse(tangent: &SVector<f64, D>) -> SMatrix<f64, D, D>;
    /// [`LieGroup::log`] and, at it, [`LieGroup::right_jacobian_inverse`]: together where that
    /// saves work.
    fn log_with_jacobian(&self) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let log = self.log();
        (log, Self::right_jacobian_inverse(&log))
    }
    /// `Ad` of the inverse.
    fn inverse_adjoint(&self) -> SMatrix<f64, D, D> {
        self.inverse().adjoint()
    }
    /// True when every coordinate is finite.
    fn is_finite(&self) -> bool;

    /// `self^-1 * other`: `other` seen from `self`.
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }
    /// `self * exp(tangent)`.
    fn retract(&self, tangent: &SVector<f64, D>) -> Self {
        self.compose(&Self::exp(tangent))
    }
}
