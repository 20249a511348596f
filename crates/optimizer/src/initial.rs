use crate::{EdgeKind, PoseGraph, components::components};
use geometry::LieGroup;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Places nodes by chaining measurements along a spanning tree, from the nodes that `known` says
/// are placed already.
///
/// Sequential edges are preferred to closures and earlier edges to later ones, so that a graph with
/// one robot's odometry comes out as that odometry. Components without a known node are placed
/// around their first node, which stays where it is.
pub fn initialize_spanning_tree<G: LieGroup<D>, const D: usize>(
    graph: &mut PoseGraph<G, D>,
    known: impl Fn(usize) -> bool,
) {
    let nodes = graph.nodes().len();
    let incident = incidence(nodes, graph.ends());
    let mut poses: Vec<G> = graph.nodes().iter().map(|node| node.pose).collect();
    let mut placed = vec![false; nodes];
    let mut queue = BinaryHeap::new();
    for root in roots(nodes, graph.ends(), known) {
        placed[root as usize] = true;
        queue.extend(incident.of(root).iter().map(|&edge| Reverse(rank(graph, edge))));
    }
    while let Some(Reverse((_, edge))) = queue.pop() {
        let [from, to] = graph.ends()[edge as usize];
        let measured = graph.edges()[edge as usize].from_from_to;
        let node = match (placed[from as usize], placed[to as usize]) {
            (true, false) => {
                poses[to as usize] = poses[from as usize].compose(&measured);
                to
            }
            (false, true) => {
                poses[from as usize] = poses[to as usize].compose(&measured.inverse());
                from
            }
            _ => continue,
        };
        placed[node as usize] = true;
        queue.extend(incident.of(node).iter().map(|&edge| Reverse(rank(graph, edge))));
    }
    graph.set_poses(&poses);
}

/// Sequential edges come before closures, earlier edges before later ones.
fn rank<G: LieGroup<D>, const D: usize>(graph: &PoseGraph<G, D>, edge: u32) -> (bool, u32) {
    (graph.edges()[edge as usize].kind == EdgeKind::Closure, edge)
}

/// The known nodes, and the first node of each component that has none.
fn roots(nodes: usize, ends: &[[u32; 2]], known: impl Fn(usize) -> bool) -> Vec<u32> {
    let component = components(nodes, ends);
    let mut has_known = vec![false; nodes];
    for node in (0..nodes).filter(|&node| known(node)) {
        has_known[component[node] as usize] = true;
    }
    (0..nodes)
        .filter(|&n| known(n) || (component[n] as usize == n && !has_known[n]))
        .map(|n| n as u32)
        .collect()
}

/// The edges at every node, in compressed rows.
pub(crate) struct Incidence {
    start: Vec<usize>,
    edges: Vec<u32>,
}

impl Incidence {
    /// The edges at `node`, in ascending order.
    pub fn of(&self, node: u32) -> &[u32] {
        &self.edges[self.start[node as usize]..self.start[node as usize + 1]]
    }
}

/// Lists the edges at every node.
pub(crate) fn incidence(nodes: usize, ends: &[[u32; 2]]) -> Incidence {
    let mut start = vec![0; nodes + 1];
    for &node in ends.iter().flatten() {
        start[node as usize + 1] += 1;
    }
    for node in 0..nodes {
        start[node + 1] += start[node];
    }
    let mut next = start.clone();
    let mut edges = vec![0; 2 * ends.len()];
    for (edge, pair) in ends.iter().enumerate() {
        for &node in pair {
            edges[next[node as usize]] = edge as u32;
            next[node as usize] += 1;
        }
    }
    Incidence { start, edges }
}
