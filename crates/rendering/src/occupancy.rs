use crate::counts::band_rows;
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

/// The decision for one band of rows.
struct Decision<'a> {
    counts: &'a HitMissCounts,
    rule: &'a OccupancyRule,
    first: usize,
    /// Radius of the ridge test in cells.
    ridge: usize,
    /// Radius of the smoothing in cells.
    blur: usize,
}

impl<'a> Decision<'a> {
    /// Beside a ridge, this share of its hits must have looked through a free cell.
    const FREE_SHARE: f64 = 0.1;

    fn new(counts: &'a HitMissCounts, rule: &'a OccupancyRule, first: usize) -> Self {
        let resolution = counts.frame().resolution_m;
        // More than 50 cells of either would be slow and mean a wrong unit.
        let cells = |metres: f64| (metres / resolution).round().clamp(0.0, 50.0) as usize;
        let (ridge, blur) = (cells(rule.ridge_radius_m), cells(rule.smoothing_m));
        Decision { counts, rule, first, ridge, blur }
    }

    /// Fills a band, and returns the cells that are wall if they lie between wall cells.
    fn decide(&self, band: &mut [Cell]) -> Vec<usize> {
        let GridFrame { width, height, .. } = *self.counts.frame();
        let low = self.first.saturating_sub(self.ridge);
        let high = (self.first + band.len() / width + self.ridge).min(height);
        let hits = self.smoothed(low, high);
        let busy = busy_chunks(&hits, width);
        let per_row = width.div_ceil(CHUNK);
        let mut peaks = vec![0_u32; width];
        let mut weak = Vec::new();
        for (i, cells) in band.chunks_mut(width).enumerate() {
            let row = self.first + i;
            let near = row.saturating_sub(self.ridge).max(low)..(row + self.ridge + 1).min(high);
            let near = near.start - low..near.end - low;
            let rows = hits[near.start * width..near.end * width].chunks(width);
            let flags = busy[near.start * per_row..near.end * per_row].chunks(per_row);
            maximum_around(rows.zip(flags), self.ridge, &mut peaks);
            let here = &hits[(row - low) * width..(row - low + 1) * width];
            let misses = &self.counts.miss_rows()[row * width..(row + 1) * width];
            for (c, cell) in cells.iter_mut().enumerate() {
                let (cell_is, closes) = self.judge(here[c], peaks[c], misses[c]);
                *cell = cell_is;
                if closes {
                    weak.push(row * width + c);
                }
            }
        }
        weak
    }

    /// What a cell is, and whether it would be wall between wall cells. `hits` and `peak` are sums
    /// over the smoothing square.
    fn judge(&self, hits: u32, peak: u32, seen_through: u16) -> (Cell, bool) {
        if peak == 0 {
            return (if seen_through > 0 { Cell::Free } else { Cell::Unknown }, false);
        }
        // A wall as thick as one cell fills one row of the square.
        let side = (2 * self.blur + 1) as f64;
        let (hits, peak) = (f64::from(hits) / side, f64::from(peak) / side);
        let misses = f64::from(seen_through);
        let share = hits > 0.0 && hits >= self.rule.wall_share * (hits + misses);
        if share && hits >= self.rule.ridge_share * peak {
            return (Cell::Occupied, false);
        }
        let free = misses > 0.0 && misses >= Self::FREE_SHARE * peak;
        let cell = if free { Cell::Free } else { Cell::Unknown };
        (cell, share && hits >= self.rule.closing_share * peak)
    }

    /// Hits of rows `low..high`, summed over the square of radius `blur` around each cell.
    fn smoothed(&self, low: usize, high: usize) -> Vec<u32> {
        let GridFrame { width, height, .. } = *self.counts.frame();
        let raw = self.counts.hit_rows();
        let mut sums = vec![0_u32; (high - low) * width];
        let mut column_sums = vec![0_u32; width];
        for (row, out) in (low..high).zip(sums.chunks_mut(width)) {
            column_sums.fill(0);
            for r in row.saturating_sub(self.blur)..(row + self.blur + 1).min(height) {
                let source = &raw[r * width..(r + 1) * width];
                column_sums.iter_mut().zip(source).for_each(|(s, h)| *s += u32::from(*h));
            }
            if self.blur == 0 {
                out.copy_from_slice(&column_sums);
                continue;
            }
            let mut sum: u32 = column_sums[..self.blur.min(width)].iter().sum();
            for (c, out) in out.iter_mut().enumerate() {
                sum += column_sums.get(c + self.blur).copied().unwrap_or(0);
                *out = sum;
                sum -= c.checked_sub(self.blur).map_or(0, |k| column_sums[k]);
            }
        }
        sums
    }
}

/// Cells that are looked at together.
const CHUNK: usize = 64;

/// Which pieces of the rows hold any hit: most hold none and need no second look.
fn busy_chunks(hits: &[u32], width: usize) -> Vec<bool> {
    let rows = hits.chunks(width);
    rows.flat_map(|row| row.chunks(CHUNK).map(|c| c.iter().fold(0, |a, v| a | v) > 0)).collect()
}

/// The largest value of all rows within `radius` columns of each column. Rows come with the flags
/// of their busy chunks.
fn maximum_around<'a>(
    rows: impl Iterator<Item = (&'a [u32], &'a [bool])>,
    radius: usize,
    peaks: &mut [u32],
) {
    let width = peaks.len();
    let mut tallest = vec![0_u32; width];
    let mut touched = vec![false; width.div_ceil(CHUNK)];
    for (row, busy) in rows {
        for (k, _) in busy.iter().enumerate().filter(|(_, busy)| **busy) {
            touched[k] = true;
            let chunk = k * CHUNK..((k + 1) * CHUNK).min(width);
            let above = tallest[chunk.clone()].iter_mut();
            above.zip(&row[chunk]).for_each(|(t, v)| *t = (*t).max(*v));
        }
    }
    // Few cells are hit: spreading those is faster than looking around every cell.
    peaks.fill(0);
    for (k, _) in touched.iter().enumerate().filter(|(_, touched)| **touched) {
        let first = k * CHUNK;
        let chunk = tallest[first..].iter().take(CHUNK).enumerate();
        for (i, &height) in chunk.filter(|(_, height)| **height > 0) {
            let c = first + i;
            let near = c.saturating_sub(radius)..(c + radius + 1).min(width);
            peaks[near].iter_mut().for_each(|peak| *peak = (*peak).max(height));
        }
    }
}
