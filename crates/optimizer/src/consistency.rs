use crate::clique::{BitGraph, maximum_clique};
use crate::gate::{chi2_quantile, mahalanobis};
use geometry::{Gaussian, LieGroup};

/// A loop closure that may be wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosureCandidate<G, const D: usize> {
    /// The node it starts from.
    pub from: u64,
    /// The node it leads to.
    pub to: u64,
    /// The measurement, `from_from_to`.
    pub measured: Gaussian<G, D>,
}

/// Settings of [`consistent_set`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsistencySettings {
    /// Squared Mahalanobis distance up to which two closures agree.
    pub max_chi2: f64,
    /// Most branches of the exact search for the largest set; beyond, the best found is returned.
    pub budget: u64,
    /// Most candidates compared; later ones are left out. Memory grows with the square.
    pub max_candidates: usize,
}

impl ConsistencySettings {
    /// Settings for residuals of `dof` degrees of freedom.
    pub fn new(dof: usize) -> Self {
        ConsistencySettings {
            max_chi2: chi2_quantile(dof, 0.99),
            budget: 100_000,
            max_candidates: 10_000,
        }
    }
}

/// A set of closures that all agree pairwise.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConsistentSet {
    /// Indices of the members among the candidates, ascending.
    pub members: Vec<usize>,
    /// True when it is certain that no larger set exists.
    pub exact: bool,
}

/// A largest set of pairwise consistent closures: pairwise consistency maximisation (Mangelson,
/// Dominic, Eustice and Vasudevan, "Pairwise consistent measurement set maximization", 2018).
///
/// `odometry(a, b)` is the trusted `a_from_b`, or `None` where there is none, such as between
/// robots that have not been joined: pairs that need it then do not agree. Two closures `i -> j`
/// and `k -> l` agree when the loop `i -> j -> l -> k -> i` comes back to its start within its own
/// uncertainty. A closure against its direction is compared by way of its inverse.
pub fn consistent_set<G: LieGroup<D>, const D: usize>(
    candidates: &[ClosureCandidate<G, D>],
    mut odometry: impl FnMut(u64, u64) -> Option<Gaussian<G, D>>,
    settings: &ConsistencySettings,
) -> ConsistentSet {
    let graph = agreements(candidates, &mut odometry, settings);
    let (members, exact) = maximum_clique(&graph, settings.budget);
    ConsistentSet { members, exact: exact && graph.nodes() == candidates.len() }
}

/// Disjoint consistent sets, largest first: the largest, then the largest among the rest, while
/// they have at least `min_members` members.
///
/// Several sets occur where wrong closures agree with each other (repeated rooms), or where right
/// ones cannot be compared.
pub fn consistent_sets<G: LieGroup<D>, const D: usize>(
    candidates: &[ClosureCandidate<G, D>],
    mut odometry: impl FnMut(u64, u64) -> Option<Gaussian<G, D>>,
    settings: &ConsistencySettings,
    min_members: usize,
) -> Vec<ConsistentSet> {
    let graph = agreements(candidates, &mut odometry, settings);
    let compared = graph.nodes() == candidates.len();
    let mut left: Vec<usize> = (0..graph.nodes()).collect();
    let mut sets = vec![];
    loop {
        let (members, exact) = maximum_clique(&graph.induced(&left), settings.budget);
        if members.len() < min_members.max(1) {
            return sets;
        }
        let members: Vec<usize> = members.into_iter().map(|member| left[member]).collect();
        left.retain(|k| members.binary_search(k).is_err());
        sets.push(ConsistentSet { members, exact: exact && compared });
    }
}

/// Which candidates agree pairwise; only the first `max_candidates` are nodes.
pub(crate) fn agreements<G: LieGroup<D>, const D: usize>(
    candidates: &[ClosureCandidate<G, D>],
    odometry: &mut impl FnMut(u64, u64) -> Option<Gaussian<G, D>>,
    settings: &ConsistencySettings,
) -> BitGraph {
    let count = candidates.len().min(settings.max_candidates);
    let mut graph = BitGraph::new(count);
    for (b, second) in candidates[..count].iter().enumerate() {
        for (a, first) in candidates[..b].iter().enumerate() {
            if agree(first, second, odometry, settings.max_chi2) {
                graph.connect(a, b);
            }
        }
    }
    graph
}

fn agree<G: LieGroup<D>, const D: usize>(
    a: &ClosureCandidate<G, D>,
    b: &ClosureCandidate<G, D>,
    odometry: &mut impl FnMut(u64, u64) -> Option<Gaussian<G, D>>,
    max_chi2: f64,
) -> bool {
    let mut path = |first: u64, last: u64, middle: &Gaussian<G, D>, ends: [u64; 2]| {
        let start = odometry(first, ends[0])?;
        let end = odometry(ends[1], last)?;
        Some(start.compose(middle).compose(&end))
    };
    let path = path(a.from, a.to, &b.measured, [b.from, b.to])
        .or_else(|| path(a.from, a.to, &b.measured.inverse(), [b.to, b.from]));
    let Some(path) = path else { return false };
    let residual = a.measured.mean.between(&path.mean).log();
    mahalanobis(&residual, &(path.covariance + a.measured.covariance))
        .is_some_and(|(squared, _)| squared <= max_chi2)
}
