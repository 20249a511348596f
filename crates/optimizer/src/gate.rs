use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// The `probability` quantile of the chi-squared distribution with `dof` degrees of freedom, by
/// Wilson and Hilferty's cube (1931): within 4 % for three and more
/// degrees of freedom up to the 0.9999 quantile.
pub fn chi2_quantile(dof: usize, probability: f64) -> f64 {
    let k = dof as f64;
    let a = 2.0 / (9.0 * k);
    k * (1.0 - a + normal_quantile(probability) * a.sqrt()).max(0.0).powi(3)
}

/// Quantile of the standard normal distribution, by bisection of [`normal_tail`].
fn normal_quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if normal_tail(middle) > 1.0 - probability { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The probability that a standard normal variable exceeds `x`: Simpson's rule on the density.
fn normal_tail(x: f64) -> f64 {
    let density = |t: f64| (-0.5 * t * t).exp() / std::f64::consts::TAU.sqrt();
    let (steps, end) = (200, 10.0_f64.max(x + 1.0));
    let h = (end - x) / f64::from(steps);
    let inner: f64 = (1..steps)
        .map(|k| if k % 2 == 1 { 4.0 } else { 2.0 } * density(x + h * f64::from(k)))
        .sum();
    (density(x) + inner + density(end)) * h / 3.0
}

/// Probability that a Poisson variable of mean `mean` is at least `count`.
pub(crate) fn poisson_tail(mean: f64, count: usize) -> f64 {
    let (mut term, mut below) = ((-mean).exp(), 0.0);
    for k in 0..count {
        below += term;
        term *= mean / (k + 1) as f64;
    }
    (1.0 - below).max(0.0)
}

/// Squared Mahalanobis length of a residual, and the square root of its covariance's determinant:
/// the volume of the one-sigma box. `None` where the covariance is not positive definite.
pub(crate) fn mahalanobis<const D: usize>(
    residual: &SVector<f64, D>,
    covariance: &SMatrix<f64, D, D>,
) -> Option<(f64, f64)> {
    let factor: Cholesky<f64, Const<D>> = Cholesky::new(*covariance)?;
    let l = factor.l_dirty();
    let (mut squared, mut volume, mut z) = (0.0, 1.0, *residual);
    for r in 0..D {
        for c in 0..r {
            z[r] -= l[(r, c)] * z[c];
        }
        z[r] /= l[(r, r)];
        squared += z[r] * z[r];
        volume *= l[(r, r)];
    }
    Some((squared, volume))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_against_the_tables() {
        for (dof, p, expected) in
            [(3, 0.95, 7.815), (3, 0.99, 11.345), (6, 0.95, 12.592), (3, 0.9999, 21.108)]
        {
            let got = chi2_quantile(dof, p);
            assert!((got / expected - 1.0).abs() < 0.04, "{dof} {p}: {got}, table {expected}");
        }
    }

    #[test]
    fn poisson_tails_by_hand() {
        assert_eq!(poisson_tail(0.7, 0), 1.0);
        assert!((poisson_tail(0.7, 1) - (1.0 - (-0.7_f64).exp())).abs() < 1e-12);
        assert!((poisson_tail(2.0, 3) - (1.0 - 5.0 * (-2.0_f64).exp())).abs() < 1e-12);
    }

    #[test]
    fn mahalanobis_against_the_inverse() {
        let covariance = SMatrix::<f64, 3, 3>::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0);
        let residual = SVector::from([1.0, -2.0, 0.3]);
        let (squared, volume) = mahalanobis(&residual, &covariance).unwrap();
        let expected = (residual.transpose() * covariance.try_inverse().unwrap() * residual).x;
        assert!((squared - expected).abs() < 1e-12);
        assert!((volume * volume - covariance.determinant()).abs() < 1e-10);
    }
}
