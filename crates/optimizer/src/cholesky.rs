use crate::{OptimizerError, structure::Structure};
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::prelude::Reborrow;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

/// A sparse Cholesky factorisation whose symbolic part and memory are kept between uses.
///
/// The matrix comes in elimination order, lower triangle, scalar compressed columns.
pub(crate) struct Cholesky {
    symbolic: SymbolicCholesky<usize>,
    lower: SymbolicSparseColMat<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
    solve_memory: MemBuffer,
    solve_columns: usize,
}

impl Cholesky {
    /// Symbolic factorisation for blocks of `dimension` unknowns.
    pub fn analyse(structure: &Structure, dimension: usize) -> Result<Self, OptimizerError> {
        let upper = scalar_upper(structure, dimension);
        let lower = scalar_lower(structure, dimension);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
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
        let solve_memory = buffer(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq))?;
        Ok(Cholesky { symbolic, lower, factor, memory, solve_memory, solve_columns: 1 })
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

    /// Solves in place for `columns` right-hand sides stored one after the other.
    pub fn solve(&mut self, rhs: &mut [f64], columns: usize) -> Result<(), OptimizerError> {
        if columns > self.solve_columns {
            let scratch = self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq);
            self.solve_memory = buffer(scratch)?;
            self.solve_columns = columns;
        }
        let rows = self.symbolic.nrows();
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(rhs, rows, columns),
            Par::Seq,
            MemStack::new(&mut self.solve_memory),
        );
        Ok(())
    }
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
