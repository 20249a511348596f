use crate::{EdgeKind, Optimizer, OptimizerError, PoseGraph, Report, RobustScope, Settings};
use geometry::LieGroup;

/// The robust loss that graduated non-convexity ends in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GncLoss {
    /// Truncated least squares: every edge ends up fully in or fully out.
    #[default]
    TruncatedLeastSquares,
    /// Geman-McClure: weights fade smoothly.
    GemanMcClure,
}

/// Settings of [`optimize_gnc`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GncSettings {
    /// The loss to end in.
    pub loss: GncLoss,
    /// Squared Mahalanobis residual up to which an edge is an inlier, a chi-squared quantile with
    /// the group's degrees of freedom.
    pub inlier_chi2: f64,
    /// Factor by which the control parameter changes per round (Yang et al. use 1.4).
    pub factor: f64,
    /// Most rounds.
    pub max_rounds: usize,
    /// The edges that may be doubted.
    pub scope: RobustScope,
    /// Settings of the optimisation within each round.
    pub inner: Settings,
}

impl GncSettings {
    /// Settings for residuals of `dof` degrees of freedom.
    pub fn new(dof: usize) -> Self {
        GncSettings {
            loss: GncLoss::default(),
            inlier_chi2: crate::chi2_quantile(dof, 0.9999),
            factor: 1.4,
            max_rounds: 100,
            scope: RobustScope::Closures,
            inner: Settings { relative_tolerance: 1e-3, max_iterations: 10, ..Settings::default() },
        }
    }
}

/// Graduated non-convexity (Yang, Antonante, Tzoumas and Carlone 2020): the robust loss is
/// approached from its convex surrogate, alternating weighted least squares and closed-form
/// weights.
///
/// The report's costs are sums of weighted squared residuals under the weights it returns.
pub fn optimize_gnc<G: LieGroup<D>, const D: usize>(
    optimizer: &mut Optimizer<G, D>,
    graph: &mut PoseGraph<G, D>,
    settings: &GncSettings,
) -> Result<Report, OptimizerError> {
    let doubted: Vec<bool> = graph
        .edges()
        .iter()
        .map(|e| settings.scope == RobustScope::All || e.kind == EdgeKind::Closure)
        .collect();
    let mut report = optimizer.optimize(graph, &settings.inner)?;
    let initial_cost = report.initial_cost;
    let mut iterations = report.iterations;
    let mut weights = vec![1.0; doubted.len()];
    let mut mu = first_mu(graph, &doubted, settings);
    let mut rounds = 0;
    while let Some(control) = mu.filter(|_| rounds < settings.max_rounds) {
        rounds += 1;
        let mut undecided = false;
        for (edge, weight) in weights.iter_mut().enumerate().filter(|(e, _)| doubted[*e]) {
            let chi2 = graph.edge_chi2(edge);
            *weight = gnc_weight(settings.loss, chi2, settings.inlier_chi2, control);
            undecided |= *weight > 0.0 && *weight < 1.0;
        }
        report = optimizer.optimize_weighted(graph, &settings.inner, &weights)?;
        iterations += report.iterations;
        mu = next_mu(control, undecided, settings);
    }
    let last = Settings { relative_tolerance: 1e-6, max_iterations: 30, ..settings.inner };
    report = optimizer.optimize_weighted(graph, &last, &weights)?;
    iterations += report.iterations;
    Ok(Report { initial_cost, iterations, ..report })
}

/// The control parameter at which the surrogate is convex; `None` when all edges are inliers.
fn first_mu<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    doubted: &[bool],
    settings: &GncSettings,
) -> Option<f64> {
    let worst = (0..doubted.len())
        .filter(|&edge| doubted[edge])
        .map(|edge| graph.edge_chi2(edge))
        .fold(0.0, f64::max);
    if worst <= settings.inlier_chi2 {
        return None;
    }
    Some(match settings.loss {
        GncLoss::TruncatedLeastSquares => {
            settings.inlier_chi2 / (2.0 * worst - settings.inlier_chi2)
        }
        GncLoss::GemanMcClure => 2.0 * worst / settings.inlier_chi2,
    })
}

fn next_mu(mu: f64, undecided: bool, settings: &GncSettings) -> Option<f64> {
    match settings.loss {
        GncLoss::TruncatedLeastSquares => undecided.then_some(mu * settings.factor),
        GncLoss::GemanMcClure => (mu > 1.0).then_some((mu / settings.factor).max(1.0)),
    }
}

/// The weight of an edge of squared residual `s` (Yang et al. 2020, eq. 12 and 14).
fn gnc_weight(loss: GncLoss, s: f64, c2: f64, mu: f64) -> f64 {
    match loss {
        GncLoss::GemanMcClure => (mu * c2 / (s + mu * c2)).powi(2),
        GncLoss::TruncatedLeastSquares => {
            if s <= mu / (mu + 1.0) * c2 {
                1.0
            } else if s >= (mu + 1.0) / mu * c2 {
                0.0
            } else {
                ((c2 * mu * (mu + 1.0) / s).sqrt() - mu).clamp(0.0, 1.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the ends of the middle branch the weight joins 1 and 0 continuously.
    #[test]
    fn weights_are_continuous_and_fall() {
        for mu in [1e-4, 0.1, 1.0, 50.0] {
            let c2 = 21.0;
            let (low, high) = (mu / (mu + 1.0) * c2, (mu + 1.0) / mu * c2);
            let weight = |s| gnc_weight(GncLoss::TruncatedLeastSquares, s, c2, mu);
            assert!((weight(low * (1.0 + 1e-9)) - 1.0).abs() < 1e-6);
            assert!(weight(high * (1.0 - 1e-9)) < 1e-6 * (1.0 + mu));
            let middle = weight(0.5 * (low + high));
            assert!(middle > 0.0 && middle < 1.0);
        }
        assert_eq!(gnc_weight(GncLoss::GemanMcClure, 21.0, 21.0, 1.0), 0.25);
    }
}
