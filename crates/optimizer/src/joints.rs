//! What joins trees of trusted edges to each other: sets of closures that agree across them.

use crate::clique::{BitGraph, maximum_clique};
use crate::consistency::agreements;
use crate::spine::{Spine, covariance_of};
use crate::{ClosureCandidate, ConsistencySettings, EdgeKind, PoseGraph};
use geometry::{Gaussian, LieGroup};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Most closures between two trees that are all compared with each other; where there are more,
/// only those are that their neighbours vouch for. The comparisons grow with the square.
const MAX_COMPARED: usize = 2000;

/// A rival with fewer members is a coincidence: any two closures may agree by chance.
const SMALLEST_RIVAL: usize = 3;

/// The closures that join two trees of trusted edges, such as two robots' odometry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Joint {
    /// The first node (its index) of either tree, the smaller first.
    pub trees: [u32; 2],
    /// Indices of the closures, ascending.
    pub members: Vec<usize>,
    /// Size of the largest set of other closures between the same trees that agree with each other
    /// and contradict these: the second best claim of how the trees lie to each other.
    pub rival: usize,
}

/// For every two trees of trusted edges that closures connect, which of those closures to believe.
///
/// Nothing says how the trees lie to each other but the closures, so they are compared with one
/// another: a largest set of pairwise consistent closures (Mangelson et al. 2018), each tree's own
/// spine giving the way between their ends. Right closures that miss a single gate are not in it.
/// `usable` says which closures may take part, where there are more than can all be compared.
///
/// Sorted by size, largest first; at least two members each.
pub fn find_joints<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    usable: impl Fn(usize) -> bool,
) -> Vec<Joint> {
    joints_along(graph, &Spine::new(graph), usable)
}

pub(crate) fn joints_along<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    spine: &Spine<G, D>,
    usable: impl Fn(usize) -> bool,
) -> Vec<Joint> {
    let mut between: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (edge, ends) in graph.ends().iter().enumerate() {
        let [a, b] = ends.map(|node| spine.root(node));
        if a != b && graph.edges()[edge].kind == EdgeKind::Closure {
            between.entry([a.min(b), a.max(b)]).or_default().push(edge);
        }
    }
    let mut joints = vec![];
    for (trees, mut edges) in between {
        if edges.len() > MAX_COMPARED {
            edges.retain(|&edge| usable(edge));
        }
        joints.extend(joint(graph, spine, trees, &edges));
    }
    joints.sort_by_key(|joint| (Reverse(joint.members.len()), joint.trees));
    joints
}

/// The largest set of agreeing closures between two trees.
fn joint<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    spine: &Spine<G, D>,
    trees: [u32; 2],
    edges: &[usize],
) -> Option<Joint> {
    let candidates: Vec<ClosureCandidate<G, D>> = edges
        .iter()
        .map(|&edge| {
            let (ends, measured) = (graph.ends()[edge], &graph.edges()[edge]);
            let [from, to] = ends.map(u64::from);
            let covariance = covariance_of(&measured.information);
            let mean = measured.from_from_to;
            ClosureCandidate { from, to, measured: Gaussian { mean, covariance } }
        })
        .collect();
    let mut odometry = |a: u64, b: u64| spine.relative(a as usize, b as usize);
    let settings =
        ConsistencySettings { max_candidates: MAX_COMPARED, ..ConsistencySettings::new(D) };
    let graph = agreements(&candidates, &mut odometry, &settings);
    let (members, rival) = best_claim(&graph, settings.budget);
    (members.len() >= 2).then(|| {
        let members = members.into_iter().map(|member| edges[member]).collect();
        Joint { trees, members, rival }
    })
}

/// The largest clique, and the size of the largest one among the others that contradicts it.
///
/// A clique leaves out right closures that miss a single gate, and these make cliques of their own;
/// they agree with most of the first one, which a rival does not.
fn best_claim(graph: &BitGraph, budget: u64) -> (Vec<usize>, usize) {
    let (members, _) = maximum_clique(graph, budget);
    let mut left: Vec<usize> = (0..graph.nodes()).filter(|k| !members.contains(k)).collect();
    loop {
        let (next, _) = maximum_clique(&graph.induced(&left), budget);
        let next: Vec<usize> = next.into_iter().map(|k| left[k]).collect();
        if next.len() < SMALLEST_RIVAL {
            return (members, 0);
        }
        let agreeing: usize = next.iter().map(|&k| graph.common(k, &members)).sum();
        if 2 * agreeing <= next.len() * members.len() {
            return (members, next.len());
        }
        left.retain(|k| !next.contains(k));
    }
}

/// The joints that make a spanning forest of the trees, largest sets first (Kruskal 1956): how the
/// trees are laid to each other before the other joints are judged by it.
pub(crate) fn spanning_joints(joints: &[Joint], nodes: usize) -> Vec<&Joint> {
    let mut chosen: Vec<&Joint> = vec![];
    let mut ends = vec![];
    for joint in joints {
        let component = crate::components::components(nodes, &ends);
        let [a, b] = joint.trees.map(|tree| component[tree as usize]);
        if a != b {
            ends.push(joint.trees);
            chosen.push(joint);
        }
    }
    chosen
}
