use crate::initial::incidence;
use crate::{EdgeKind, PoseGraph};
use geometry::{Gaussian, LieGroup};
use nalgebra::SMatrix;

/// No node.
const NONE: u32 = u32::MAX;

/// A spanning forest of the trusted (sequential) edges: what is known of the relative poses of
/// nodes without any closure.
///
/// With *left* perturbations, `T = exp(xi) T_mean`, the uncertainty along a path adds up:
/// `xi` of a node is the sum of `Ad(T_k) delta_k` over the edges from the root. So one sum per
/// node gives the Gaussian between any two nodes of a tree at once.
#[derive(Debug)]
pub struct Spine<G, const D: usize> {
    /// Place of each node in a depth-first walk; along a chain, neighbours are consecutive.
    pub(crate) order: Vec<u32>,
    /// The root of the tree each node belongs to.
    tree: Vec<u32>,
    parent: Vec<u32>,
    /// A far ancestor: climbing by it takes logarithmic time (Myers 1983).
    jump: Vec<u32>,
    depth: Vec<u32>,
    /// `root_from_node`.
    pose: Vec<G>,
    /// Covariance of the left perturbation.
    sum: Vec<SMatrix<f64, D, D>>,
}

impl<G: LieGroup<D>, const D: usize> Spine<G, D> {
    /// Walks every tree of sequential edges from its first node.
    pub fn new(graph: &PoseGraph<G, D>) -> Self {
        let n = graph.nodes().len();
        let incident = incidence(n, graph.ends());
        let mut spine = Spine {
            order: vec![NONE; n],
            tree: vec![0; n],
            parent: vec![NONE; n],
            jump: vec![NONE; n],
            depth: vec![0; n],
            pose: vec![G::identity(); n],
            sum: vec![SMatrix::zeros(); n],
        };
        let (mut next, mut stack) = (0, vec![]);
        for root in 0..n as u32 {
            if spine.order[root as usize] != NONE {
                continue;
            }
            spine.jump[root as usize] = root;
            stack.push((root, NONE));
            while let Some((node, edge)) = stack.pop() {
                if spine.order[node as usize] != NONE {
                    continue;
                }
                spine.order[node as usize] = next;
                spine.tree[node as usize] = root;
                next += 1;
                if edge != NONE {
                    spine.attach(graph, node, edge as usize);
                }
                for &edge in incident.of(node).iter().rev() {
                    let [from, to] = graph.ends()[edge as usize];
                    let other = if from == node { to } else { from };
                    let trusted = graph.edges()[edge as usize].kind == EdgeKind::Sequential;
                    if trusted && spine.order[other as usize] == NONE {
                        stack.push((other, edge));
                    }
                }
            }
        }
        spine
    }

    /// The root, the first node of the tree that `node` belongs to; both are indices.
    pub(crate) fn root(&self, node: u32) -> u32 {
        self.tree[node as usize]
    }

    /// `a_from_b` along the tree, for node *indices*; `None` between different trees.
    pub fn relative(&self, a: usize, b: usize) -> Option<Gaussian<G, D>> {
        let (i, j) = (a, b);
        if self.tree[i] != self.tree[j] {
            return None;
        }
        if a == b {
            return Some(Gaussian::exact(G::identity()));
        }
        let common = self.common_ancestor(a as u32, b as u32) as usize;
        let sum = self.sum[i] + self.sum[j] - self.sum[common] * 2.0;
        let ad = self.pose[j].inverse_adjoint();
        let mean = self.pose[i].between(&self.pose[j]);
        Some(Gaussian { mean, covariance: ad * sum * ad.transpose() })
    }

    /// Puts `node` below the other end of `edge`.
    fn attach(&mut self, graph: &PoseGraph<G, D>, node: u32, edge: usize) {
        let [from, to] = graph.ends()[edge];
        let above = if from == node { to } else { from };
        let (n, p) = (node as usize, above as usize);
        let measured = graph.edges()[edge].from_from_to;
        let step = if to == node { measured } else { measured.inverse() };
        self.parent[n] = above;
        self.depth[n] = self.depth[p] + 1;
        self.pose[n] = self.pose[p].compose(&step);
        // The measurement's right perturbation, carried to the root's frame on the left.
        let target = if to == node { &self.pose[n] } else { &self.pose[p] };
        let ad = target.adjoint();
        let covariance = covariance_of(&graph.edges()[edge].information);
        self.sum[n] = self.sum[p] + ad * covariance * ad.transpose();
        let (j, jj) = (self.jump[p], self.jump[self.jump[p] as usize]);
        let even = self.depth[p] - self.depth[j as usize]
            == self.depth[j as usize] - self.depth[jj as usize];
        self.jump[n] = if even { jj } else { above };
    }

    fn common_ancestor(&self, mut a: u32, mut b: u32) -> u32 {
        if self.depth[a as usize] < self.depth[b as usize] {
            std::mem::swap(&mut a, &mut b);
        }
        let level = self.depth[b as usize];
        while self.depth[a as usize] > level {
            let far = self.jump[a as usize];
            a = if self.depth[far as usize] >= level { far } else { self.parent[a as usize] };
        }
        while a != b {
            let (far_a, far_b) = (self.jump[a as usize], self.jump[b as usize]);
            (a, b) = if far_a == far_b {
                (self.parent[a as usize], self.parent[b as usize])
            } else {
                (far_a, far_b)
            };
        }
        a
    }
}

/// The covariance of a measurement; directions it says nothing about get a very large one.
pub(crate) fn covariance_of<const D: usize>(
    information: &SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    information.try_inverse().filter(|c| c.iter().all(|x| x.is_finite())).unwrap_or_else(|| {
        let floor = 1e-9 * information.amax().max(1e-9);
        (information + SMatrix::identity() * floor)
            .try_inverse()
            .unwrap_or(SMatrix::identity() * 1e12)
    })
}
