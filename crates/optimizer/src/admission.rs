use crate::components::components;
use crate::gate::{chi2_quantile, mahalanobis};
use crate::spine::covariance_of;
use crate::support::Alternative;
use crate::{EdgeKind, Marginals, Optimizer, OptimizerError, PoseGraph};
use geometry::LieGroup;
use std::f64::consts::TAU;

/// Least probability that a closure is right, for it to be taken in.
const BELIEF: f64 = 0.998;

/// Probability that a right closure is thrown out for contradicting the others: small beside one
/// over the number of closures.
const FALSE_ALARM: f64 = 1e-6;

/// A closure that leaves a smaller share of its contradiction in its own residual is hardly
/// controlled by the others; it gets the benefit of the doubt.
const LEAST_CONTROL: f64 = 0.05;

/// What a look at every closure in the light of all others recommends.
#[derive(Debug, Default)]
pub(crate) struct Review {
    /// Closures to take in.
    pub admit: Vec<usize>,
    /// Closures to throw out.
    pub withdraw: Vec<usize>,
}

/// Judges every closure against the estimate made from the others.
pub(crate) fn review<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    kept: &PoseGraph<G, D>,
    optimizer: &mut Optimizer<G, D>,
    inliers: &[bool],
    model: &Alternative,
) -> Result<Review, OptimizerError> {
    let closures = graph.edges().iter().enumerate().filter(|(_, e)| e.kind == EdgeKind::Closure);
    let closures: Vec<usize> = closures.map(|(edge, _)| edge).collect();
    let out = closures.iter().filter(|&&edge| !inliers[edge]).count();
    let odds = (closures.len() - out + 1) as f64 / (out + 1) as f64;
    let alarm = chi2_quantile(D, 1.0 - FALSE_ALARM) * model.scale;
    let in_doubt = |edge: usize| !inliers[edge] || graph.edge_chi2(edge) > LEAST_CONTROL * alarm;
    let part = parts(kept);
    let known =
        |edge: usize| part[graph.ends()[edge][0] as usize] == part[graph.ends()[edge][1] as usize];
    let closures: Vec<usize> =
        closures.into_iter().filter(|&edge| in_doubt(edge) && known(edge)).collect();
    let ends = |&edge: &usize| [graph.edges()[edge].from, graph.edges()[edge].to];
    let ids: Vec<u64> = closures.iter().flat_map(ends).collect();
    let marginals = optimizer.marginals(kept, &ids)?;
    let mut review = Review::default();
    let mut worst = vec![];
    for &edge in &closures {
        if inliers[edge] {
            worst.extend(contradiction(graph, &marginals, edge, alarm).map(|d2| (d2, edge)));
        } else if is_likely(graph, &marginals, edge, model, odds) {
            review.admit.push(edge);
        }
    }
    // One wrong closure bends its neighbourhood and makes right ones look wrong: the worst go
    // first, the others get another look.
    worst.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    worst.truncate(worst.len().div_ceil(4));
    review.withdraw = worst.into_iter().map(|(_, edge)| edge).collect();
    Ok(review)
}

/// A label per node; between nodes of different labels the estimate says nothing, and no closure
/// can be judged: their parts hang together neither by edges nor by fixed nodes.
fn parts<G: LieGroup<D>, const D: usize>(kept: &PoseGraph<G, D>) -> Vec<u32> {
    let mut ends = kept.ends().to_vec();
    let fixed: Vec<u32> =
        (0..kept.nodes().len() as u32).filter(|&n| kept.nodes()[n as usize].fixed).collect();
    ends.extend(fixed.windows(2).map(|pair| [pair[0], pair[1]]));
    components(kept.nodes().len(), &ends)
}

/// True when a closure that was left out is more likely right than wrong.
///
/// A right closure's residual at the optimum is Gaussian with the covariance of its measurement
/// plus that of the estimate between its ends; a wrong one's is spread over the alternative's
/// volume. Bayes' rule with the present share of believed closures as the prior decides, and where
/// the estimate is loose it asks for more.
fn is_likely<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    marginals: &Marginals<G, D>,
    edge: usize,
    model: &Alternative,
    odds: f64,
) -> bool {
    let closure = &graph.edges()[edge];
    let Some(estimate) = marginals.relative(closure.from, closure.to) else { return false };
    let covariance = (estimate.covariance + covariance_of(&closure.information)) * model.scale;
    let residual = closure.residual(&estimate.mean);
    let Some((squared, volume)) = mahalanobis(&residual, &covariance) else { return false };
    let density = (-0.5 * squared).exp() / (TAU.powf(0.5 * D as f64) * volume);
    squared <= model.gate && odds * density * model.volume > BELIEF / (1.0 - BELIEF)
}

/// How much a believed closure contradicts all others, if by more than `alarm`.
///
/// Data snooping (Baarda 1968): a residual `r` left after the fit has the covariance `R - P`,
/// measurement less estimate, and `r^T (R - P)^-1 r` is what the squared distance of the closure
/// from an estimate made without it would be. A closure that nothing else controls passes.
fn contradiction<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    marginals: &Marginals<G, D>,
    edge: usize,
    alarm: f64,
) -> Option<f64> {
    let closure = &graph.edges()[edge];
    let estimate = marginals.relative(closure.from, closure.to)?;
    let measured = covariance_of(&closure.information);
    let residual = closure.residual(&estimate.mean);
    // A trace of the measurement's own covariance keeps rounding from inventing contradictions.
    let left = measured * (1.0 + 1e-6) - estimate.covariance;
    let (squared, _) = mahalanobis(&residual, &left)?;
    (squared > alarm).then_some(squared)
}
