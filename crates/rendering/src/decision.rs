use crate::{Cell, GridFrame, HitMissCounts, OccupancyRule};

/// The decision for one band of rows.
pub(crate) struct Decision<'a> {
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

    pub fn new(counts: &'a HitMissCounts, rule: &'a OccupancyRule, first: usize) -> Self {
        let resolution = counts.frame().resolution_m;
        // More than 50 cells of either would be slow and mean a wrong unit.
        let cells = |metres: f64| (metres / resolution).round().clamp(0.0, 50.0) as usize;
        let (ridge, blur) = (cells(rule.ridge_radius_m), cells(rule.smoothing_m));
        Decision { counts, rule, first, ridge, blur }
    }

    /// Fills a band, and returns the cells that are wall if they lie between wall cells.
    pub fn decide(&self, band: &mut [Cell]) -> Vec<usize> {
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
