use crate::cholesky::HalfSolution;
use crate::structure::HELD;
use crate::{Optimizer, OptimizerError, PoseGraph, Settings};
use geometry::{Gaussian, LieGroup};
use nalgebra::SMatrix;

/// Joint covariance of some nodes of a graph, in the tangent spaces of their poses.
///
/// With `H = L L^T` and `Y = L^-1 E` for the unit columns `E` of a node, the covariance between two
/// nodes is `Y_a^T Y_b`. A `Y` fills only one path of the elimination tree, so that many nodes
/// cost little, and any pair of them can be asked for afterwards.
#[derive(Clone, Debug)]
pub struct Marginals<G, const D: usize> {
    ids: Vec<u64>,
    poses: Vec<G>,
    /// `None` for held nodes, which are certain.
    halves: Vec<Option<HalfSolution<D>>>,
}

impl<G: LieGroup<D>, const D: usize> Marginals<G, D> {
    /// Covariance between two nodes; `None` if one was not asked for. Zero for held nodes.
    pub fn covariance(&self, a: u64, b: u64) -> Option<SMatrix<f64, D, D>> {
        Some(self.block(self.place(a)?, self.place(b)?))
    }

    /// `map_from_node` with its covariance.
    pub fn node(&self, id: u64) -> Option<Gaussian<G, D>> {
        let place = self.place(id)?;
        Some(Gaussian { mean: self.poses[place], covariance: self.block(place, place) })
    }

    /// `a_from_b` with its covariance, correlations of the two poses included:
    /// the right perturbation of `a^-1 b` is `db - Ad(b_from_a) da`.
    pub fn relative(&self, a: u64, b: u64) -> Option<Gaussian<G, D>> {
        let (a, b) = (self.place(a)?, self.place(b)?);
        let mean = self.poses[a].between(&self.poses[b]);
        let ad = mean.inverse_adjoint();
        let cross = ad * self.block(a, b);
        let covariance =
            self.block(b, b) + ad * self.block(a, a) * ad.transpose() - cross - cross.transpose();
        Some(Gaussian { mean, covariance })
    }

    fn place(&self, id: u64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }

    fn block(&self, a: usize, b: usize) -> SMatrix<f64, D, D> {
        match (&self.halves[a], &self.halves[b]) {
            (Some(a), Some(b)) => a.product(b),
            _ => SMatrix::zeros(),
        }
    }
}

impl<G: LieGroup<D>, const D: usize> Optimizer<G, D> {
    /// Joint covariance of the nodes `ids` at the graph's poses, every edge counting fully.
    pub fn marginals(
        &mut self,
        graph: &PoseGraph<G, D>,
        ids: &[u64],
    ) -> Result<Marginals<G, D>, OptimizerError> {
        let mut ids = ids.to_vec();
        ids.sort_unstable();
        ids.dedup();
        let mut nodes = vec![];
        for &id in &ids {
            nodes.push(graph.index_of(id).ok_or(OptimizerError::UnknownNode { id })?);
        }
        self.prepare(graph, &Settings::default(), None)?;
        let system = self.factorized()?;
        let places: Vec<u32> = nodes.iter().map(|&n| system.structure.position[n]).collect();
        let free: Vec<u32> = places.iter().copied().filter(|&place| place != HELD).collect();
        let mut solved = system.half_solutions(&free).into_iter();
        let halves = places.iter().map(|&p| if p == HELD { None } else { solved.next() }).collect();
        let poses = nodes.iter().map(|&node| graph.nodes()[node].pose).collect();
        Ok(Marginals { ids, poses, halves })
    }
}
