use crate::admission::review;
use crate::gate::chi2_quantile;
use crate::spine::Spine;
use crate::support::{Alternative, supported};
use crate::{EdgeKind, GncSettings, Optimizer, OptimizerError, PoseGraph, Report, Settings};
use crate::{initialize_spanning_tree, optimize_gnc};
use geometry::LieGroup;

/// Most rounds of taking closures in and out after the skeleton has been found.
const MAX_ROUNDS: usize = 20;

/// Most closures that are tried together when hardly any is vouched for.
const MAX_UNSUPPORTED: usize = 2000;

/// Settings of [`optimize_robust`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustSettings {
    /// Squared Mahalanobis residual up to which a closure is believed.
    pub inlier_chi2: f64,
    /// Start from the trusted edges alone, whatever the nodes' poses are.
    pub from_odometry: bool,
    /// Settings of the last optimisation.
    pub last: Settings,
}

impl RobustSettings {
    /// Settings for residuals of `dof` degrees of freedom.
    pub fn new(dof: usize) -> Self {
        RobustSettings {
            inlier_chi2: chi2_quantile(dof, 0.9999),
            from_odometry: true,
            last: Settings::default(),
        }
    }
}

/// What [`optimize_robust`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustReport {
    /// The last optimisation, over the edges that were kept.
    pub report: Report,
    /// For every edge of the graph whether it was believed; sequential edges always are.
    pub inliers: Vec<bool>,
    /// Closures vouched for by their neighbours: those that the search began with.
    pub supported: usize,
}

/// Optimises a graph many of whose closures may be wrong, and says which.
///
/// 1. Closures that agree with closures nearby, beyond chance, make a skeleton. This needs only
///    the trusted edges, so it does not matter how far odometry has drifted.
/// 2. The skeleton is optimised by graduated non-convexity, which throws out what does not fit.
/// 3. Closures that fit the result are taken in and those that do not are thrown out, until
///    nothing changes: truncated least squares by alternation, from a start near its optimum.
pub fn optimize_robust<G: LieGroup<D>, const D: usize>(
    graph: &mut PoseGraph<G, D>,
    settings: &RobustSettings,
) -> Result<RobustReport, OptimizerError> {
    let spine = Spine::new(graph);
    let (mut inliers, volume) = supported(graph, &spine);
    let supported = inliers.iter().filter(|x| **x).count();
    let closures = graph.edges().iter().filter(|e| e.kind == EdgeKind::Closure).count();
    // Closures too far apart to vouch for each other: all of them are tried together.
    let all = 10 * supported < closures && closures <= MAX_UNSUPPORTED;
    for (inlier, edge) in inliers.iter_mut().zip(graph.edges()) {
        *inlier |= all || edge.kind == EdgeKind::Sequential;
    }
    if settings.from_odometry {
        let fixed: Vec<bool> = graph.nodes().iter().map(|node| node.fixed).collect();
        let mut skeleton = graph.filtered(|edge| inliers[edge]);
        initialize_spanning_tree(&mut skeleton, |node| fixed[node]);
        copy_poses(graph, &skeleton);
    }
    let mut optimizer = Optimizer::new();
    let mut model = Alternative { volume, gate: settings.inlier_chi2, scale: 1.0 };
    let mut withdrawn = vec![false; inliers.len()];
    let mut round = 0;
    loop {
        let report = settle(graph, &mut optimizer, &mut inliers, &mut model)?;
        let kept = graph.filtered(|edge| inliers[edge]);
        let mut review = review(graph, &kept, &mut optimizer, &inliers, &model)?;
        // What was thrown out after a second look does not come back: this ends.
        review.admit.retain(|&edge| !withdrawn[edge]);
        round += 1;
        if (review.admit.is_empty() && review.withdraw.is_empty()) || round == MAX_ROUNDS {
            return Ok(RobustReport { report, inliers, supported });
        }
        for edge in review.withdraw {
            (inliers[edge], withdrawn[edge]) = (false, round > 2);
        }
        for edge in review.admit {
            inliers[edge] = true;
        }
    }
}

/// Optimises the edges believed so far and withdraws those that do not fit.
fn settle<G: LieGroup<D>, const D: usize>(
    graph: &mut PoseGraph<G, D>,
    optimizer: &mut Optimizer<G, D>,
    inliers: &mut [bool],
    model: &mut Alternative,
) -> Result<Report, OptimizerError> {
    loop {
        let mut kept = graph.filtered(|edge| inliers[edge]);
        let inlier_chi2 = model.gate * model.scale;
        let gnc = GncSettings { inlier_chi2, ..GncSettings::new(D) };
        let report = optimize_gnc(optimizer, &mut kept, &gnc)?;
        copy_poses(graph, &kept);
        let before = inliers.iter().filter(|x| **x).count();
        withdraw(inliers, &report.weights);
        let after = inliers.iter().filter(|x| **x).count();
        let scale = variance_factor(&kept, &report.weights);
        let changed = scale < 0.8 * model.scale;
        model.scale = scale;
        if !changed && before == after {
            return Ok(report);
        }
    }
}

/// How large the residuals are beside what the information matrices promise: the a-posteriori
/// variance factor of adjustment theory, with a margin of 2.5 for caution, between a twentieth and one.
///
/// Logs with cautious covariances are common; without this, a wrong closure passes in them whose
/// residual is far larger than any right one's.
fn variance_factor<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    weights: &[f64],
) -> f64 {
    const PRIOR: f64 = 10.0;
    let kept = weights.iter().filter(|w| **w > 0.5).count();
    let chi2: f64 = weights.iter().enumerate().map(|(e, w)| w * graph.edge_chi2(e)).sum();
    let freedom = (D * (kept + 1)).saturating_sub(D * graph.nodes().len()) as f64;
    (2.5 * (chi2 + PRIOR) / (freedom + PRIOR)).clamp(0.05, 1.0)
}

/// Marks the believed edges whose weight vanished as outliers.
fn withdraw(inliers: &mut [bool], weights: &[f64]) {
    let kept = inliers.iter_mut().filter(|inlier| **inlier);
    for (inlier, weight) in kept.zip(weights) {
        *inlier = *weight > 0.5;
    }
}

fn copy_poses<G: LieGroup<D>, const D: usize>(to: &mut PoseGraph<G, D>, from: &PoseGraph<G, D>) {
    let poses: Vec<G> = from.nodes().iter().map(|node| node.pose).collect();
    to.set_poses(&poses);
}
