use crate::OptimizerError;
use geometry::{Gaussian, LieGroup};
use nalgebra::{SMatrix, SVector};
use std::collections::HashMap;

/// How an edge came about, which decides whether a robust method may doubt it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EdgeKind {
    /// Between consecutive poses (odometry, scan matching of neighbours): trusted.
    Sequential,
    /// A loop closure or merge: may be wrong, and may be rejected.
    Closure,
}

/// A pose to be estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<G> {
    /// The caller's name for the node.
    pub id: u64,
    /// `map_from_node`.
    pub pose: G,
    /// True when the optimiser must leave the pose alone.
    pub fixed: bool,
}

/// A measured relative pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge<G, const D: usize> {
    /// Id of the node in whose frame the measurement is expressed.
    pub from: u64,
    /// Id of the measured node.
    pub to: u64,
    /// The measurement, `from_from_to`.
    pub from_from_to: G,
    /// Inverse covariance of the measurement's right perturbation, translation first.
    pub information: SMatrix<f64, D, D>,
    /// Where the edge comes from.
    pub kind: EdgeKind,
}

impl<G: LieGroup<D>, const D: usize> Edge<G, D> {
    /// An edge from its parts.
    pub fn new(
        from: u64,
        to: u64,
        from_from_to: G,
        information: SMatrix<f64, D, D>,
        kind: EdgeKind,
    ) -> Self {
        Edge { from, to, from_from_to, information, kind }
    }

    /// The residual `log(measured^-1 * estimated)`, with `estimated` as `from_from_to`.
    pub fn residual(&self, estimated: &G) -> SVector<f64, D> {
        self.from_from_to.between(estimated).log()
    }

    /// The measurement with its covariance; `None` where the information is singular.
    pub fn gaussian(&self) -> Option<Gaussian<G, D>> {
        let covariance = self.information.try_inverse()?;
        Some(Gaussian { mean: self.from_from_to, covariance })
    }
}

/// Poses and the measurements between them: the input and output of the optimiser.
///
/// Nodes and edges keep the order in which they were added, and everything computed from a graph
/// depends on that order alone.
#[derive(Clone, Debug, Default)]
pub struct PoseGraph<G, const D: usize> {
    nodes: Vec<Node<G>>,
    edges: Vec<Edge<G, D>>,
    ends: Vec<[u32; 2]>,
    index: HashMap<u64, u32>,
}

impl<G: LieGroup<D>, const D: usize> PoseGraph<G, D> {
    /// An empty graph.
    pub fn new() -> Self {
        PoseGraph { nodes: vec![], edges: vec![], ends: vec![], index: HashMap::new() }
    }

    /// Adds a free node at `pose` (`map_from_node`) and returns its index.
    pub fn add_node(&mut self, id: u64, pose: G) -> Result<usize, OptimizerError> {
        if !pose.is_finite() {
            return Err(OptimizerError::PoseNotFinite { id });
        }
        if self.index.contains_key(&id) {
            return Err(OptimizerError::DuplicateNode { id });
        }
        let index = u32::try_from(self.nodes.len()).map_err(|_| OptimizerError::TooLarge)?;
        self.index.insert(id, index);
        self.nodes.push(Node { id, pose, fixed: false });
        Ok(index as usize)
    }

    /// Adds an edge between existing nodes and returns its index.
    ///
    /// Parallel edges are welcome; their information adds up.
    pub fn add_edge(&mut self, edge: Edge<G, D>) -> Result<usize, OptimizerError> {
        let ends = [self.position(edge.from)?, self.position(edge.to)?];
        let (from, to) = (edge.from, edge.to);
        if from == to {
            return Err(OptimizerError::SelfEdge { id: from });
        }
        if !edge.from_from_to.is_finite() {
            return Err(OptimizerError::MeasurementNotFinite { from, to });
        }
        if !is_information(&edge.information) {
            return Err(OptimizerError::BadInformation { from, to });
        }
        if self.edges.len() >= u32::MAX as usize {
            return Err(OptimizerError::TooLarge);
        }
        self.edges.push(edge);
        self.ends.push(ends);
        Ok(self.edges.len() - 1)
    }

    /// Replaces the measurement of edge `edge`, keeping its ends and kind: no new analysis needed.
    pub fn remeasure(
        &mut self,
        edge: usize,
        from_from_to: G,
        information: SMatrix<f64, D, D>,
    ) -> Result<(), OptimizerError> {
        let (from, to) = (self.edges[edge].from, self.edges[edge].to);
        if !from_from_to.is_finite() {
            return Err(OptimizerError::MeasurementNotFinite { from, to });
        }
        if !is_information(&information) {
            return Err(OptimizerError::BadInformation { from, to });
        }
        self.edges[edge].from_from_to = from_from_to;
        self.edges[edge].information = information;
        Ok(())
    }

    /// Fixes a node's pose, or frees it. Without a fixed node, the first node of each connected
    /// component is held.
    pub fn set_fixed(&mut self, id: u64, fixed: bool) -> Result<(), OptimizerError> {
        let index = self.index_of(id).ok_or(OptimizerError::UnknownNode { id })?;
        self.nodes[index].fixed = fixed;
        Ok(())
    }

    /// Moves a node.
    pub fn set_pose(&mut self, id: u64, pose: G) -> Result<(), OptimizerError> {
        let index = self.index_of(id).ok_or(OptimizerError::UnknownNode { id })?;
        if !pose.is_finite() {
            return Err(OptimizerError::PoseNotFinite { id });
        }
        self.nodes[index].pose = pose;
        Ok(())
    }

    /// The nodes in the order they were added.
    pub fn nodes(&self) -> &[Node<G>] {
        &self.nodes
    }

    /// The edges in the order they were added.
    pub fn edges(&self) -> &[Edge<G, D>] {
        &self.edges
    }

    /// The node indices (not ids) of every edge's ends, `[from, to]`.
    pub fn ends(&self) -> &[[u32; 2]] {
        &self.ends
    }

    /// The index of a node in [`PoseGraph::nodes`].
    pub fn index_of(&self, id: u64) -> Option<usize> {
        self.index.get(&id).map(|&index| index as usize)
    }

    /// The pose of a node, `map_from_node`.
    pub fn pose(&self, id: u64) -> Option<&G> {
        self.index_of(id).map(|index| &self.nodes[index].pose)
    }

    /// Squared Mahalanobis length of an edge's residual at the current poses.
    pub fn edge_chi2(&self, edge: usize) -> f64 {
        let [from, to] = self.ends[edge];
        let (a, b) = (&self.nodes[from as usize].pose, &self.nodes[to as usize].pose);
        let residual = self.edges[edge].residual(&a.between(b));
        (self.edges[edge].information * residual).dot(&residual)
    }

    /// Sum of [`PoseGraph::edge_chi2`] over all edges.
    pub fn chi2(&self) -> f64 {
        (0..self.edges.len()).map(|edge| self.edge_chi2(edge)).sum()
    }

    /// A graph with the same nodes and the edges that `keep` accepts, in the same order.
    pub fn filtered(&self, mut keep: impl FnMut(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.edges.len()).filter(|&edge| keep(edge)).collect();
        PoseGraph {
            nodes: self.nodes.clone(),
            edges: kept.iter().map(|&edge| self.edges[edge]).collect(),
            ends: kept.iter().map(|&edge| self.ends[edge]).collect(),
            index: self.index.clone(),
        }
    }

    pub(crate) fn set_poses(&mut self, poses: &[G]) {
        for (node, pose) in self.nodes.iter_mut().zip(poses) {
            node.pose = *pose;
        }
    }

    fn position(&self, id: u64) -> Result<u32, OptimizerError> {
        self.index.get(&id).copied().ok_or(OptimizerError::UnknownNode { id })
    }
}

/// True for a finite, symmetric, positive semi-definite matrix, up to rounding: a Cholesky
/// factorisation that tolerates pivots down to a rounding error below zero.
fn is_information<const D: usize>(matrix: &SMatrix<f64, D, D>) -> bool {
    let scale = matrix.amax();
    if !scale.is_finite() || scale > 1e100 {
        return false;
    }
    let asymmetry = (matrix - matrix.transpose()).amax();
    if asymmetry > 1e-9 * scale {
        return false;
    }
    let shifted = matrix + SMatrix::identity() * (1e-9 * scale).max(f64::MIN_POSITIVE);
    nalgebra::Cholesky::new(shifted).is_some()
}
