use crate::{OptimizerError, components::anchored};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// The position of a node that is held and has no unknowns.
pub(crate) const HELD: u32 = u32::MAX;

/// The block sparsity of the information matrix, in elimination order, and where every edge's
/// blocks go in it.
///
/// Only the lower triangle exists: block column `c` holds its diagonal block and the blocks
/// `rows[row_start[c]..row_start[c + 1]]` below it.
#[derive(Debug, Default)]
pub(crate) struct Structure {
    /// Position in elimination order of each node, or [`HELD`].
    pub position: Vec<u32>,
    /// For each position the node standing there.
    pub node_at: Vec<u32>,
    /// Start of each block column in `rows`; one more entry than there are columns.
    pub row_start: Vec<usize>,
    /// Block rows below the diagonal, sorted within each column.
    pub rows: Vec<u32>,
    /// For each edge between free nodes the index in `rows` of its off-diagonal block.
    pub edge_block: Vec<usize>,
    ends: Vec<[u32; 2]>,
    fixed: Vec<bool>,
}

impl Structure {
    /// Orders the nodes by approximate minimum degree on the *block* graph (Amestoy, Davis and
    /// Duff 1996), a `D^2` times smaller problem than ordering the scalar matrix.
    pub fn analyse(ends: &[[u32; 2]], fixed: Vec<bool>) -> Result<Self, OptimizerError> {
        let held = anchored(fixed.len(), ends, &fixed);
        let free: Vec<u32> = (0..fixed.len() as u32).filter(|&n| !held[n as usize]).collect();
        let mut variable = vec![HELD; fixed.len()];
        for (k, &node) in free.iter().enumerate() {
            variable[node as usize] = k as u32;
        }
        let pairs = block_pairs(ends, &variable);
        let rank = minimum_degree(free.len(), &pairs)?;
        let mut node_at = vec![0; free.len()];
        let mut position = vec![HELD; fixed.len()];
        for (k, &node) in free.iter().enumerate() {
            node_at[rank[k]] = node;
            position[node as usize] = rank[k] as u32;
        }
        let pairs = sorted(pairs.iter().map(|pair| pair.map(|k| rank[k as usize] as u32)));
        let row_start = column_starts(free.len(), pairs.iter().map(|pair| pair[0]));
        let rows: Vec<u32> = pairs.iter().map(|pair| pair[1]).collect();
        let mut structure = Structure {
            position,
            node_at,
            row_start,
            rows,
            edge_block: vec![],
            ends: ends.to_vec(),
            fixed,
        };
        structure.edge_block = ends.iter().map(|&pair| structure.block_of(pair)).collect();
        Ok(structure)
    }

    /// True when this analysis is that of a graph with these edges and fixed nodes.
    pub fn fits(&self, ends: &[[u32; 2]], fixed: impl ExactSizeIterator<Item = bool>) -> bool {
        self.fixed.len() == fixed.len()
            && self.ends == ends
            && self.fixed.iter().zip(fixed).all(|(a, b)| *a == b)
    }

    /// Number of free nodes.
    pub fn columns(&self) -> usize {
        self.node_at.len()
    }

    /// The positions of every edge's ends.
    pub fn edge_positions(&self) -> Vec<[u32; 2]> {
        self.ends.iter().map(|ends| ends.map(|node| self.position[node as usize])).collect()
    }

    fn block_of(&self, [a, b]: [u32; 2]) -> usize {
        let (p, q) = (self.position[a as usize], self.position[b as usize]);
        if p == HELD || q == HELD {
            return usize::MAX;
        }
        let column = p.min(q) as usize;
        let (start, end) = (self.row_start[column], self.row_start[column + 1]);
        start + self.rows[start..end].partition_point(|&row| row < p.max(q))
    }
}

/// The distinct pairs `[smaller, larger]` of labels that edges connect, sorted; edges with a held
/// end are left out.
fn block_pairs(ends: &[[u32; 2]], label: &[u32]) -> Vec<[u32; 2]> {
    let pairs = ends.iter().map(|&[a, b]| [label[a as usize], label[b as usize]]);
    let mut pairs = sorted(pairs.filter(|pair| !pair.contains(&HELD)));
    pairs.dedup();
    pairs
}

/// Pairs with the smaller first, sorted.
fn sorted(pairs: impl Iterator<Item = [u32; 2]>) -> Vec<[u32; 2]> {
    // One number is compared faster than two.
    let mut packed: Vec<u64> =
        pairs.map(|[a, b]| u64::from(a.min(b)) << 32 | u64::from(a.max(b))).collect();
    packed.sort_unstable();
    packed.into_iter().map(|pair| [(pair >> 32) as u32, pair as u32]).collect()
}

/// Prefix sums of the number of entries in each column; `sorted` lists the column of each entry.
fn column_starts(columns: usize, sorted: impl Iterator<Item = u32>) -> Vec<usize> {
    let mut starts = vec![0; columns + 1];
    for column in sorted {
        starts[column as usize + 1] += 1;
    }
    for column in 0..columns {
        starts[column + 1] += starts[column];
    }
    starts
}

/// The elimination rank of each variable.
fn minimum_degree(n: usize, pairs: &[[u32; 2]]) -> Result<Vec<usize>, OptimizerError> {
    if n == 0 {
        return Ok(vec![]);
    }
    let starts = column_starts(n, pairs.iter().map(|pair| pair[0]));
    let rows: Vec<usize> = pairs.iter().map(|pair| pair[1] as usize).collect();
    let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
    let (mut order, mut rank) = (vec![0_usize; n], vec![0_usize; n]);
    let scratch = amd::order_scratch::<usize>(n, rows.len());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| OptimizerError::OutOfMemory)?;
    amd::order(&mut order, &mut rank, pattern, amd::Control::default(), MemStack::new(&mut memory))
        .map_err(|_| OptimizerError::TooLarge)?;
    Ok(rank)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_finds_its_block_and_ranks_are_a_permutation() {
        let ends = [[0, 1], [1, 2], [2, 3], [3, 0], [1, 3], [3, 1], [2, 1]];
        let structure = Structure::analyse(&ends, vec![true, false, false, false]).unwrap();
        assert_eq!(structure.columns(), 3);
        let mut ranks = structure.position[1..].to_vec();
        ranks.sort_unstable();
        assert_eq!(ranks, [0, 1, 2]);
        for (pair, &block) in ends.iter().zip(&structure.edge_block) {
            let places = pair.map(|node| structure.position[node as usize]);
            if places.contains(&HELD) {
                assert_eq!(block, usize::MAX);
                continue;
            }
            assert_eq!(structure.rows[block], places[0].max(places[1]));
            let column = places[0].min(places[1]) as usize;
            assert!(
                (structure.row_start[column]..structure.row_start[column + 1]).contains(&block)
            );
        }
    }
}
