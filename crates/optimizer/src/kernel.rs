/// A robust kernel: how much a residual of squared Mahalanobis length `s` counts.
///
/// Scales are in units of `s` (chi-squared), so a scale is a quantile of the chi-squared
/// distribution with `D` degrees of freedom. Every kernel behaves as `s` near zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Kernel {
    /// Plain least squares.
    #[default]
    Quadratic,
    /// Linear growth beyond `scale` (Huber 1964).
    Huber {
        /// Where the linear part begins.
        scale: f64,
    },
    /// Logarithmic growth.
    Cauchy {
        /// Where the weight is one half.
        scale: f64,
    },
    /// Dynamic covariance scaling (Agarwal et al. 2013); the weight is the square of their scale.
    Dcs {
        /// The parameter `Phi`: residuals up to it count fully.
        scale: f64,
    },
    /// Bounded by `scale` (Geman and McClure 1985).
    GemanMcClure {
        /// Where the weight is one quarter.
        scale: f64,
    },
    /// Least squares truncated at `scale`: residuals beyond it do not count at all.
    Truncated {
        /// Where the residual stops counting.
        scale: f64,
    },
}

impl Kernel {
    /// The robust cost `rho(s)`.
    pub fn cost(&self, s: f64) -> f64 {
        match *self {
            Kernel::Quadratic => s,
            Kernel::Huber { scale } if s > scale => 2.0 * (scale * s).sqrt() - scale,
            Kernel::Huber { .. } => s,
            Kernel::Cauchy { scale } => scale * (s / scale).ln_1p(),
            // The integral of the squared scale factor (MacTavish and Barfoot 2015).
            Kernel::Dcs { scale } if s > scale => scale * (3.0 * s - scale) / (s + scale),
            Kernel::Dcs { .. } => s,
            Kernel::GemanMcClure { scale } => scale * (s / (scale + s)),
            Kernel::Truncated { scale } => s.min(scale),
        }
    }

    /// The weight `d rho / d s` of iteratively re-weighted least squares.
    pub fn weight(&self, s: f64) -> f64 {
        match *self {
            Kernel::Quadratic => 1.0,
            Kernel::Huber { scale } if s > scale => (scale / s).sqrt(),
            Kernel::Huber { .. } => 1.0,
            Kernel::Cauchy { scale } => scale / (scale + s),
            Kernel::Dcs { scale } if s > scale => (2.0 * scale / (scale + s)).powi(2),
            Kernel::Dcs { .. } => 1.0,
            Kernel::GemanMcClure { scale } => (scale / (scale + s)).powi(2),
            Kernel::Truncated { scale } => f64::from(u8::from(s <= scale)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Kernel;

    const KERNELS: [Kernel; 6] = [
        Kernel::Quadratic,
        Kernel::Huber { scale: 2.0 },
        Kernel::Cauchy { scale: 2.0 },
        Kernel::Dcs { scale: 2.0 },
        Kernel::GemanMcClure { scale: 2.0 },
        Kernel::Truncated { scale: 2.0 },
    ];

    #[test]
    fn weight_is_the_derivative_of_cost() {
        for kernel in KERNELS {
            for s in [0.0, 0.1, 1.0, 1.9, 2.1, 5.0, 100.0] {
                let h = 1e-6;
                let numeric = (kernel.cost(s + h) - kernel.cost((s - h).max(0.0))) / (h + s.min(h));
                assert!((numeric - kernel.weight(s)).abs() < 1e-5, "{kernel:?} at {s}");
            }
        }
    }

    #[test]
    fn kernels_grow_at_most_as_the_square_and_never_shrink() {
        for kernel in KERNELS {
            let mut last = 0.0;
            for s in (0..200).map(|k| 0.1 * f64::from(k)) {
                let cost = kernel.cost(s);
                assert!(cost <= s + 1e-12 && cost >= last - 1e-12, "{kernel:?} at {s}");
                last = cost;
            }
        }
    }
}
