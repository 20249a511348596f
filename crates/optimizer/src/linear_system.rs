use crate::OptimizerError;
use crate::cholesky::{Cholesky, HalfSolution};
use crate::structure::{HELD, Structure};
use nalgebra::{SMatrix, SVector};

/// The normal equations `H step = -gradient`, assembled into a fixed pattern.
#[derive(Debug)]
pub(crate) struct LinearSystem<const D: usize> {
    pub structure: Structure,
    cholesky: Cholesky,
    /// Scalar entries of the lower triangle of `H`, columns in elimination order.
    values: Vec<f64>,
    /// Where each block column starts in `values`.
    column_start: Vec<usize>,
    /// Where each edge's off-diagonal block starts in `values`, and the length of its column.
    edge_slot: Vec<(usize, usize)>,
    /// The undamped diagonal of `H`.
    diagonal: Vec<f64>,
    gradient: Vec<f64>,
    step: Vec<f64>,
}

impl<const D: usize> LinearSystem<D> {
    /// Analyses the structure once and sets all memory aside.
    pub fn new(structure: Structure) -> Result<Self, OptimizerError> {
        let cholesky = Cholesky::analyse(&structure, D)?;
        let n = structure.columns();
        let mut column_start = vec![0; n + 1];
        for column in 0..n {
            let length = D * (1 + structure.row_start[column + 1] - structure.row_start[column]);
            column_start[column + 1] = column_start[column] + D * length - D * (D - 1) / 2;
        }
        let edge_slot = edge_slots::<D>(&structure, &column_start);
        Ok(LinearSystem {
            values: vec![0.0; cholesky.entries()],
            diagonal: vec![0.0; n * D],
            gradient: vec![0.0; n * D],
            step: vec![0.0; n * D],
            structure,
            cholesky,
            column_start,
            edge_slot,
        })
    }

    /// Sets everything to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
        self.gradient.fill(0.0);
    }

    /// Adds to the diagonal block and gradient of the node at `position`, unless it is held.
    pub fn add_node(&mut self, position: u32, h: &SMatrix<f64, D, D>, g: &SVector<f64, D>) {
        if position == HELD {
            return;
        }
        let column = position as usize;
        let length = self.column_length(column);
        let mut at = self.column_start[column];
        for a in 0..D {
            for b in a..D {
                self.values[at + b - a] += h[(b, a)];
            }
            self.gradient[column * D + a] += g[a];
            at += length - a;
        }
    }

    /// Adds the block coupling an edge's ends: `h` with rows of its `from` node and columns of its
    /// `to` node. Both ends must be free.
    pub fn add_coupling(&mut self, edge: usize, from_first: bool, h: &SMatrix<f64, D, D>) {
        let (mut at, length) = self.edge_slot[edge];
        for a in 0..D {
            let slots = &mut self.values[at..at + D];
            for (b, slot) in slots.iter_mut().enumerate() {
                *slot += if from_first { h[(a, b)] } else { h[(b, a)] };
            }
            at += length - 1 - a;
        }
    }

    /// Remembers the undamped diagonal; call when everything has been added.
    pub fn finish(&mut self) {
        for column in 0..self.structure.columns() {
            let length = self.column_length(column);
            let mut at = self.column_start[column];
            for a in 0..D {
                self.diagonal[column * D + a] = self.values[at];
                at += length - a;
            }
        }
    }

    /// Solves `(H + damping diag(H)) step = -gradient`; false if that is not positive definite or
    /// the step is not finite.
    pub fn solve(&mut self, damping: f64) -> bool {
        if !self.factorize(damping) {
            return false;
        }
        for (step, gradient) in self.step.iter_mut().zip(&self.gradient) {
            *step = -gradient;
        }
        self.cholesky.solve(&mut self.step);
        self.step.iter().all(|x| x.is_finite())
    }

    /// The last solution, in elimination order.
    pub fn step(&self) -> &[f64] {
        &self.step
    }

    /// How much the last step lowers the sum of squares, if the model were exact:
    /// `-2 g.s - s.H s`, which is `s.(damping diag(H)) s - g.s` for a solution of the system.
    pub fn predicted_decrease(&self, damping: f64) -> f64 {
        let terms = self.step.iter().zip(&self.gradient).zip(&self.diagonal);
        terms.map(|((s, g), d)| s * (damping * self.floor(*d) * s - g)).sum()
    }

    /// Factorises `H + damping diag(H)`; false if that is not positive definite.
    pub fn factorize(&mut self, damping: f64) -> bool {
        for column in 0..self.structure.columns() {
            let length = self.column_length(column);
            let mut at = self.column_start[column];
            for a in 0..D {
                let undamped = self.diagonal[column * D + a];
                self.values[at] = undamped + damping * self.floor(undamped);
                at += length - a;
            }
        }
        self.cholesky.factorize(&self.values)
    }

    /// For each position the half of its block column of the inverse; see
    /// [`Cholesky::half_solve`].
    pub fn half_solutions(&self, positions: &[u32]) -> Vec<HalfSolution<D>> {
        let mut work = vec![[0.0; D]; self.gradient.len()];
        let solve = |&position| self.cholesky.half_solve(position as usize * D, &mut work);
        positions.iter().map(solve).collect()
    }

    /// Damping must also reach directions no edge constrains.
    fn floor(&self, diagonal: f64) -> f64 {
        diagonal.max(1e-6)
    }

    fn column_length(&self, column: usize) -> usize {
        let starts = &self.structure.row_start;
        D * (1 + starts[column + 1] - starts[column])
    }
}

/// Scalar `a` of a block column of scalar length `length` starts at
/// `start + a length - a (a - 1) / 2`, since the part above the diagonal is not stored.
fn edge_slots<const D: usize>(structure: &Structure, starts: &[usize]) -> Vec<(usize, usize)> {
    let slot = |(edge, &[p, q]): (usize, &[u32; 2])| {
        if p == HELD || q == HELD {
            return (usize::MAX, 0);
        }
        let column = p.min(q) as usize;
        let first = structure.row_start[column];
        let length = D * (1 + structure.row_start[column + 1] - first);
        let below = structure.edge_block[edge] - first;
        (starts[column] + D + D * below, length)
    };
    structure.edge_positions().iter().enumerate().map(slot).collect()
}
