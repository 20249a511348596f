use crate::counts::band_rows;
use crate::decision::Decision;
use crate::{GridFrame, HitMissCounts};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What a cell is taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum Cell {
    /// Nothing is known.
    #[default]
    Unknown,
    /// Scans looked through it.
    Free,
    /// Scans saw a surface in it.
    Occupied,
}

/// When a cell counts as wall, and when as free.
///
/// Four tests, each against one fault of plain hit-and-miss maps:
/// 1. *Share.* Hits must be at least `wall_share` of all that was seen of the cell. Well below one
///    half, since a wall cell is also looked through: by rays that pass it at grazing incidence and
///    by scans whose pose is a centimetre off. Without it people who walked by stay in the map.
/// 2. *Ridge.* Hits must be at least `ridge_share` of the most hit cell within `ridge_radius_m`.
///    Range and pose noise spread a wall over several cells, and behind it no ray ever passes that
///    could clear them: the share test alone draws walls too thick, and thicker the longer they
///    were looked at. The ridge of the hits is where the wall most likely is. For the same reason a
///    cell beside a ridge is free only if a tenth as many scans looked through it as hit the ridge.
/// 3. *Closing.* A cell between two wall cells needs only `closing_share` instead of `ridge_share`:
///    chance leaves single holes in oblique walls.
/// 4. *Company.* A cell with no occupied neighbour needs two scans that saw it: one stray beam
///    draws no speck.
///
/// Hits are first summed over `smoothing_m` around a cell, so that at fine resolutions, where few
/// scans hit the very same cell, a wall stays closed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OccupancyRule {
    /// Smallest share of hits among hits and misses, 0 to 1.
    pub wall_share: f64,
    /// Smallest share of the most hit cell near by, 0 to 1.
    pub ridge_share: f64,
    /// The same for cells between two wall cells.
    pub closing_share: f64,
    /// How far the most hit cell is looked for, metres: two to three times the noise of a hit.
    pub ridge_radius_m: f64,
    /// Radius over which hits are summed, metres.
    pub smoothing_m: f64,
}

impl Default for OccupancyRule {
    fn default() -> Self {
        OccupancyRule {
            wall_share: 0.25,
            ridge_share: 0.45,
            closing_share: 0.15,
            ridge_radius_m: 0.05,
            smoothing_m: 0.01,
        }
    }
}

/// A map of free, occupied and unknown cells.
#[derive(Clone, Debug, PartialEq)]
pub struct OccupancyGrid {
    frame: GridFrame,
    cells: Vec<Cell>,
}

impl OccupancyGrid {
    /// Decides every cell, in parallel on the current rayon pool.
    pub fn decide(counts: &HitMissCounts, rule: &OccupancyRule) -> Self {
        let frame = *counts.frame();
        let mut cells = vec![Cell::Unknown; frame.len()];
        let band_rows = band_rows(&frame);
        let band_len = (band_rows * frame.width).max(1);
        let weak: Vec<Vec<usize>> = cells
            .par_chunks_mut(band_len)
            .enumerate()
            .map(|(i, band)| Decision::new(counts, rule, i * band_rows).decide(band))
            .collect();
        let mut grid = OccupancyGrid { frame, cells };
        let closed: Vec<usize> =
            weak.into_iter().flatten().filter(|&index| grid.closes_wall(index)).collect();
        closed.into_iter().for_each(|index| grid.cells[index] = Cell::Occupied);
        for (index, cell) in grid.lonely(counts) {
            grid.cells[index] = cell;
        }
        grid
    }

    /// A grid from its cells, row by row from the bottom.
    ///
    /// Cells that are missing are unknown; surplus cells are dropped.
    pub fn from_cells(frame: GridFrame, mut cells: Vec<Cell>) -> Self {
        cells.resize(frame.len(), Cell::Unknown);
        OccupancyGrid { frame, cells }
    }

    /// Where the grid lies.
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// One cell.
    pub fn cell(&self, column: usize, row: usize) -> Cell {
        self.cells[row * self.frame.width + column]
    }

    /// One row of cells; row 0 is the lowest.
    pub fn row(&self, row: usize) -> &[Cell] {
        &self.cells[row * self.frame.width..(row + 1) * self.frame.width]
    }

    /// How many cells are of a kind.
    pub fn count(&self, kind: Cell) -> usize {
        self.cells.iter().filter(|c| **c == kind).count()
    }

    /// The same map without its unknown borders, but for a margin.
    pub fn trimmed(self, margin_m: f64) -> Self {
        let GridFrame { width, height, resolution_m, .. } = self.frame;
        let margin = (margin_m.max(0.0) / resolution_m) as usize;
        let known = |row: &[Cell]| row.iter().any(|c| *c != Cell::Unknown);
        let rows: Vec<usize> = (0..height).filter(|&r| known(self.row(r))).collect();
        let (Some(&bottom), Some(&top)) = (rows.first(), rows.last()) else { return self };
        let (mut left, mut right) = (width, 0);
        for &r in &rows {
            let row = self.row(r);
            left = left.min(row.iter().position(|c| *c != Cell::Unknown).unwrap_or(width));
            right = right.max(row.iter().rposition(|c| *c != Cell::Unknown).unwrap_or(0));
        }
        let (left, bottom) = (left.saturating_sub(margin), bottom.saturating_sub(margin));
        let (right, top) = ((right + margin).min(width - 1), (top + margin).min(height - 1));
        if (left, bottom, right + 1, top + 1) == (0, 0, width, height) {
            return self;
        }
        self.crop(left, bottom, right + 1 - left, top + 1 - bottom)
    }

    fn crop(self, left: usize, bottom: usize, width: usize, height: usize) -> Self {
        let cells = (bottom..bottom + height)
            .flat_map(|r| self.row(r)[left..left + width].iter().copied())
            .collect();
        let corner = nalgebra::Vector2::new(left as f64, bottom as f64) * self.frame.resolution_m;
        let frame = GridFrame { origin: self.frame.origin + corner, width, height, ..self.frame };
        OccupancyGrid { frame, cells }
    }

    /// Do two occupied cells face each other across this one?
    fn closes_wall(&self, index: usize) -> bool {
        let (width, height) = (self.frame.width, self.frame.height);
        let (column, row) = (index % width, index / width);
        if column == 0 || row == 0 || column + 1 >= width || row + 1 >= height {
            return false;
        }
        let occupied = |at: usize| self.cells[at] == Cell::Occupied;
        let steps = [1, width, width + 1, width - 1];
        steps.iter().any(|step| occupied(index - step) && occupied(index + step))
    }

    /// Occupied cells without occupied neighbours that one scan alone saw, and what they are
    /// instead.
    fn lonely(&self, counts: &HitMissCounts) -> Vec<(usize, Cell)> {
        let (width, height) = (self.frame.width, self.frame.height);
        let in_row = |row: usize| {
            let occupied = move |c: usize| self.cell(c, row) == Cell::Occupied;
            (0..width).filter(move |&c| occupied(c)).filter_map(move |c| {
                let (r0, r1) = (row.saturating_sub(1), (row + 1).min(height - 1));
                let (c0, c1) = (c.saturating_sub(1), (c + 1).min(width - 1));
                let block = (r0..=r1).flat_map(|r| &self.row(r)[c0..=c1]);
                let alone = block.filter(|b| **b == Cell::Occupied).count() == 1;
                let seen_through = counts.misses(c, row) > 0;
                let instead = if seen_through { Cell::Free } else { Cell::Unknown };
                (alone && counts.hits(c, row) < 2).then_some((row * width + c, instead))
            })
        };
        (0..height).into_par_iter().flat_map_iter(in_row).collect()
    }
}
