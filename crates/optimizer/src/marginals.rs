use crate::structure::HELD;
use crate::{Optimizer, OptimizerError, PoseGraph, Settings};
use geometry::{Gaussian, LieGroup};
use nalgebra::SMatrix;

/// Nodes whose covariance columns are solved for at a time, which bounds the memory.
const BATCH: usize = 32;

/// Joint covariance of some nodes of a graph, in the tangent spaces of their poses.
#[derive(Clone, Debug)]
pub struct Marginals<G, const D: usize> {
    ids: Vec<u64>,
    poses: Vec<G>,
    blocks: Vec<SMatrix<f64, D, D>>,
}

impl<G: LieGroup<D>, const D: usize> Marginals<G, D> {
    /// Covariance between two nodes; `None` if one was not asked for. Zero for held nodes.
    pub fn covariance(&self, a: u64, b: u64) -> Option<SMatrix<f64, D, D>> {
        let (a, b) = (self.place(a)?, self.place(b)?);
        Some(self.blocks[a * self.ids.len() + b])
    }

    /// `map_from_node` with its covariance.
    pub fn node(&self, id: u64) -> Option<Gaussian<G, D>> {
        let place = self.place(id)?;
        Some(Gaussian { mean: self.poses[place], covariance: self.covariance(id, id)? })
    }

    /// `a_from_b` with its covariance, correlations of the two poses included:
    /// the right perturbation of `a^-1 b` is `db - Ad(b_from_a) da`.
    pub fn relative(&self, a: u64, b: u64) -> Option<Gaussian<G, D>> {
        let mean = self.poses[self.place(a)?].between(&self.poses[self.place(b)?]);
        let ad = mean.inverse().adjoint();
        let cross = ad * self.covariance(a, b)?;
        let covariance = self.covariance(b, b)? + ad * self.covariance(a, a)? * ad.transpose()
            - cross
            - cross.transpose();
        Some(Gaussian { mean, covariance })
    }

    fn place(&self, id: u64) -> Option<usize> {
        self.ids.binary_search(&id).ok()
    }
}

impl<G: LieGroup<D>, const D: usize> Optimizer<G, D> {
    /// Joint covariance of the nodes `ids` at the graph's poses, every edge counting fully, by a
    /// factorisation and one block column of right-hand sides per node.
    ///
    /// Memory grows with the square of the number of nodes asked for; ask in pieces.
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
        let poses = nodes.iter().map(|&node| graph.nodes()[node].pose).collect();
        let blocks = self.covariance_blocks(&nodes)?;
        Ok(Marginals { ids, poses, blocks })
    }

    /// All blocks between `nodes`, row by row.
    fn covariance_blocks(
        &mut self,
        nodes: &[usize],
    ) -> Result<Vec<SMatrix<f64, D, D>>, OptimizerError> {
        let system = self.factorized()?;
        let size = system.structure.columns() * D;
        let places: Vec<u32> = nodes.iter().map(|&n| system.structure.position[n]).collect();
        let mut blocks = vec![SMatrix::zeros(); nodes.len() * nodes.len()];
        let free: Vec<usize> = (0..nodes.len()).filter(|&k| places[k] != HELD).collect();
        for batch in free.chunks(BATCH) {
            let mut columns = vec![0.0; size * D * batch.len()];
            for (k, &node) in batch.iter().enumerate() {
                for a in 0..D {
                    columns[size * (k * D + a) + places[node] as usize * D + a] = 1.0;
                }
            }
            system.solve_columns(&mut columns, D * batch.len())?;
            for (k, &node) in batch.iter().enumerate() {
                for &row in &free {
                    let at = places[row] as usize * D;
                    blocks[row * nodes.len() + node] =
                        SMatrix::from_fn(|b, a| columns[size * (k * D + a) + at + b]);
                }
            }
        }
        Ok(blocks)
    }
}
