use crate::{OptimizerError, structure::Structure};
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::prelude::Reborrow;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::linalg::{SupernodalThreshold, SymbolicSupernodalParams};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Par, Side};
use nalgebra::SMatrix;
use std::ops::Range;

/// Adjacent supernodes are merged up to this many columns while the zeros stored for it stay below
/// this share. Coarser than faer's own choice, since columns come in blocks of three or six:
/// a fifth faster on the graphs of `bench/optimizer`.
const RELAXATION: &[(usize, f64)] = &[(12, 1.0), (24, 0.8), (48, 0.3), (usize::MAX, 0.1)];

/// A sparse Cholesky factorisation whose symbolic part and memory are kept between uses.
///
/// The matrix comes in elimination order, lower triangle, scalar compressed columns.
pub(crate) struct Cholesky {
    symbolic: SymbolicCholesky<usize>,
    lower: SymbolicSparseColMat<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
    supernodes: Vec<Supernode>,
    /// The row patterns of the supernodes.
    rows: Vec<u32>,
    supernode_of: Vec<u32>,
    gathered: Vec<f64>,
}

impl Cholesky {
    /// Symbolic factorisation for blocks of `dimension` unknowns.
    pub fn analyse(structure: &Structure, dimension: usize) -> Result<Self, OptimizerError> {
        let upper = scalar_upper(structure, dimension);
        let lower = scalar_lower(structure, dimension);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            supernodal_params: SymbolicSupernodalParams { relax: Some(RELAXATION) },
            ..Default::default()
        };
        // faer wants the upper triangle here and the lower one in the numeric step.
        let symbolic = factorize_symbolic_cholesky(
            upper.rb(),
            Side::Upper,
            SymmetricOrdering::Identity,
            parameters,
        )
        .map_err(|_| OptimizerError::OutOfMemory)?;
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let factor = vec![0.0; symbolic.len_val()];
        let memory = buffer(scratch)?;
        let (supernodes, rows) = supernodes(&symbolic);
        let mut supernode_of = vec![0; symbolic.nrows()];
        for (s, node) in supernodes.iter().enumerate() {
            supernode_of[node.start..node.start + node.columns].fill(s as u32);
        }
        let gathered = vec![0.0; symbolic.nrows()];
        Ok(Cholesky { symbolic, lower, factor, memory, supernodes, rows, supernode_of, gathered })
    }

    /// Number of stored entries of the matrix.
    pub fn entries(&self) -> usize {
        self.lower.row_idx().len()
    }

    /// Factorises; false when the matrix is not positive definite.
    pub fn factorize(&mut self, values: &[f64]) -> bool {
        self.symbolic
            .factorize_numeric_llt::<f64>(
                &mut self.factor,
                SparseColMatRef::new(self.lower.rb(), values),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.memory),
                Default::default(),
            )
            .is_ok()
    }

    /// Solves in place for one right-hand side: `L y = b`, then `L^T x = y`.
    pub fn solve(&mut self, x: &mut [f64]) {
        for s in 0..self.supernodes.len() {
            self.supernodes[s].forward(&self.factor, &self.rows, x, &mut self.gathered);
        }
        for s in (0..self.supernodes.len()).rev() {
            self.supernodes[s].backward(&self.factor, &self.rows, x, &mut self.gathered);
        }
    }

    /// `L^-1` applied to the `D` unit vectors from scalar column `column` on.
    ///
    /// The result is non-zero only on the path from that column to the root of the elimination
    /// tree, so the cost is that of the path and not of the matrix. `work` must be zero and comes
    /// back zero.
    pub fn half_solve<const D: usize>(
        &self,
        column: usize,
        work: &mut [[f64; D]],
    ) -> HalfSolution<D> {
        for a in 0..D {
            work[column + a][a] = 1.0;
        }
        let mut half = HalfSolution { path: vec![], values: vec![] };
        let mut sums = vec![];
        let mut next = Some(column);
        while let Some(column) = next {
            let s = self.supernode_of[column] as usize;
            half.path.push((s as u32, half.values.len() as u32));
            let supernode = &self.supernodes[s];
            supernode.half_forward(&self.factor, &self.rows, work, &mut sums);
            let own = &mut work[supernode.start..supernode.start + supernode.columns];
            half.values.extend_from_slice(own);
            own.fill([0.0; D]);
            next = self.rows[supernode.pattern.clone()].first().map(|&row| row as usize);
        }
        half
    }
}

/// Columns of `L` that share one sparsity pattern, stored as a dense column-major matrix: a lower
/// triangle on top, the rows of the pattern below.
#[derive(Debug)]
struct Supernode {
    start: usize,
    columns: usize,
    pattern: Range<usize>,
    values: Range<usize>,
}

impl Supernode {
    fn forward(&self, factor: &[f64], rows: &[u32], x: &mut [f64], sums: &mut [f64]) {
        let (below, rows) = (self.pattern.len(), &rows[self.pattern.clone()]);
        let sums = &mut sums[..below];
        sums.fill(0.0);
        let own = &mut x[self.start..self.start + self.columns];
        let columns = factor[self.values.clone()].chunks_exact(self.columns + below);
        for (j, column) in columns.enumerate() {
            let (top, bottom) = column.split_at(self.columns);
            let value = own[j] / top[j];
            own[j] = value;
            for (x, l) in own[j + 1..].iter_mut().zip(&top[j + 1..]) {
                *x -= l * value;
            }
            for (sum, l) in sums.iter_mut().zip(bottom) {
                *sum += l * value;
            }
        }
        for (&row, sum) in rows.iter().zip(sums) {
            x[row as usize] -= *sum;
        }
    }

    fn backward(&self, factor: &[f64], rows: &[u32], x: &mut [f64], gathered: &mut [f64]) {
        let (below, rows) = (self.pattern.len(), &rows[self.pattern.clone()]);
        for (value, &row) in gathered.iter_mut().zip(rows) {
            *value = x[row as usize];
        }
        let own = &mut x[self.start..self.start + self.columns];
        let columns = factor[self.values.clone()].chunks_exact(self.columns + below);
        for (j, column) in columns.enumerate().rev() {
            let (top, bottom) = column.split_at(self.columns);
            let sum = dot(&own[j + 1..], &top[j + 1..]) + dot(bottom, &gathered[..below]);
            own[j] = (own[j] - sum) / top[j];
        }
    }

    fn half_forward<const D: usize>(
        &self,
        factor: &[f64],
        rows: &[u32],
        work: &mut [[f64; D]],
        sums: &mut Vec<[f64; D]>,
    ) {
        let (below, rows) = (self.pattern.len(), &rows[self.pattern.clone()]);
        sums.clear();
        sums.resize(below, [0.0; D]);
        let own = &mut work[self.start..self.start + self.columns];
        let columns = factor[self.values.clone()].chunks_exact(self.columns + below);
        for (j, column) in columns.enumerate() {
            let (top, bottom) = column.split_at(self.columns);
            let value = own[j].map(|x| x / top[j]);
            own[j] = value;
            if value == [0.0; D] {
                continue;
            }
            for (x, l) in own[j + 1..].iter_mut().zip(&top[j + 1..]) {
                for a in 0..D {
                    x[a] -= l * value[a];
                }
            }
            for (sum, l) in sums.iter_mut().zip(bottom) {
                for a in 0..D {
                    sum[a] += l * value[a];
                }
            }
        }
        for (&row, sum) in rows.iter().zip(sums) {
            for a in 0..D {
                work[row as usize][a] -= sum[a];
            }
        }
    }
}

/// Eight partial sums, so that the additions need not wait for each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_blocks, b_blocks) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a_blocks.zip(b_blocks) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// `L^-1` of some unit vectors; see [`Cholesky::half_solve`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HalfSolution<const D: usize> {
    /// Supernodes in ascending order, and where their values start.
    path: Vec<(u32, u32)>,
    values: Vec<[f64; D]>,
}

impl<const D: usize> HalfSolution<D> {
    /// The block of the inverse between the columns the two were made for.
    pub fn product(&self, other: &Self) -> SMatrix<f64, D, D> {
        let mut block = SMatrix::zeros();
        // Two paths join and then stay together to the root, with the same number of values left.
        let (mut i, mut j) = (0, 0);
        while self.path[i].0 != other.path[j].0 {
            let behind = self.path[i].0 < other.path[j].0;
            let end = if behind { self.path.len() == i + 1 } else { other.path.len() == j + 1 };
            if end {
                return block;
            }
            if behind { i += 1 } else { j += 1 }
        }
        let mine = &self.values[self.path[i].1 as usize..];
        for (x, y) in mine.iter().zip(&other.values[other.path[j].1 as usize..]) {
            for a in 0..D {
                for b in 0..D {
                    block[(a, b)] += x[a] * y[b];
                }
            }
        }
        block
    }
}

/// The supernodes of a symbolic factorisation, and their row patterns one after the other.
fn supernodes(symbolic: &SymbolicCholesky<usize>) -> (Vec<Supernode>, Vec<u32>) {
    let (mut supernodes, mut rows) = (vec![], vec![]);
    // The empty matrix is the only one for which faer does not do as it was told.
    let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { return (supernodes, rows) };
    for s in 0..raw.n_supernodes() {
        let (start, end) = (raw.supernode_begin()[s], raw.supernode_end()[s]);
        let first = rows.len();
        rows.extend(raw.supernode(s).pattern().iter().map(|&row| row as u32));
        let value = raw.col_ptr_for_val()[s];
        let columns = end - start;
        let values = value..value + columns * (columns + rows.len() - first);
        supernodes.push(Supernode { start, columns, pattern: first..rows.len(), values });
    }
    (supernodes, rows)
}

fn buffer(scratch: StackReq) -> Result<MemBuffer, OptimizerError> {
    MemBuffer::try_new(scratch).map_err(|_| OptimizerError::OutOfMemory)
}

/// The scalar pattern of the lower triangle.
fn scalar_lower(structure: &Structure, d: usize) -> SymbolicSparseColMat<usize> {
    let n = structure.columns();
    let (mut starts, mut rows) = (vec![0], vec![]);
    for column in 0..n {
        let below = &structure.rows[structure.row_start[column]..structure.row_start[column + 1]];
        for a in 0..d {
            rows.extend(d * column + a..d * (column + 1));
            rows.extend(below.iter().flat_map(|&r| d * r as usize..d * (r as usize + 1)));
            starts.push(rows.len());
        }
    }
    SymbolicSparseColMat::new_checked(n * d, n * d, starts, None, rows)
}

/// The scalar pattern of the upper triangle.
fn scalar_upper(structure: &Structure, d: usize) -> SymbolicSparseColMat<usize> {
    let n = structure.columns();
    let mut above = vec![vec![]; n];
    for column in 0..n {
        for &row in &structure.rows[structure.row_start[column]..structure.row_start[column + 1]] {
            above[row as usize].push(column);
        }
    }
    let (mut starts, mut rows) = (vec![0], vec![]);
    for (column, above) in above.iter().enumerate() {
        for a in 0..d {
            rows.extend(above.iter().flat_map(|&r| d * r..d * (r + 1)));
            rows.extend(d * column..=d * column + a);
            starts.push(rows.len());
        }
    }
    SymbolicSparseColMat::new_checked(n * d, n * d, starts, None, rows)
}

impl std::fmt::Debug for Cholesky {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cholesky").field("entries", &self.entries()).finish_non_exhaustive()
    }
}
