use crate::sweep::Sweep;
use crate::{GridFrame, RenderError, ScanView};
use geometry::Vector2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How far a scan's beams are believed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CastSettings {
    /// Hits beyond this range only clear the space up to it, metres.
    pub max_range_m: f64,
    /// A beam without return clears space only up to here, metres: black and glass surfaces return
    /// nothing from any distance.
    pub no_return_clear_m: f64,
}

impl Default for CastSettings {
    fn default() -> Self {
        CastSettings { max_range_m: 25.0, no_return_clear_m: 3.0 }
    }
}

/// For every cell, how many scans saw a surface in it and how many looked through it.
///
/// Counts are whole numbers, added up; so they depend neither on the order of the scans nor on the
/// number of threads. They saturate at 65,535.
#[derive(Clone, Debug, PartialEq)]
pub struct HitMissCounts {
    frame: GridFrame,
    hits: Vec<u16>,
    misses: Vec<u16>,
}

/// Rows that one task works on: about a megabyte of counts, so that they stay in a core's cache.
pub(crate) fn band_rows(frame: &GridFrame) -> usize {
    ((1 << 18) / frame.width.max(1)).max(64)
}

/// Scans whose outlines are held in memory at a time.
const BATCH: usize = 256;

impl HitMissCounts {
    /// Casts scans into a grid, in parallel on the current rayon pool. What lies outside the grid
    /// is clipped.
    ///
    /// # Errors
    /// A pose that is not finite.
    pub fn cast(
        frame: GridFrame,
        views: &[ScanView],
        settings: &CastSettings,
    ) -> Result<Self, RenderError> {
        views.iter().enumerate().try_for_each(|(i, view)| view.check(i))?;
        let mut chunks = views.chunks(usize::from(u16::MAX));
        let mut sum = Self::cast_chunk(frame, chunks.next().unwrap_or(&[]), settings);
        for chunk in chunks {
            let part = Self::cast_chunk(frame, chunk, settings);
            add_saturating(&mut sum.hits, &part.hits);
            add_saturating(&mut sum.misses, &part.misses);
        }
        Ok(sum)
    }

    /// Where the grid lies.
    pub fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Scans that saw a surface in the cell.
    pub fn hits(&self, column: usize, row: usize) -> u16 {
        self.hits[row * self.frame.width + column]
    }

    /// Scans that looked through the cell.
    pub fn misses(&self, column: usize, row: usize) -> u16 {
        self.misses[row * self.frame.width + column]
    }

    /// All hit counts, row by row from the bottom.
    pub(crate) fn hit_rows(&self) -> &[u16] {
        &self.hits
    }

    /// All miss counts, row by row from the bottom.
    pub(crate) fn miss_rows(&self) -> &[u16] {
        &self.misses
    }

    /// At most 65,535 views, so that no miss count can overflow.
    ///
    /// A scan's free polygon is not filled: each of its edges adds +1 or -1 in the first cell to
    /// its right, row by row, and one running sum along every row at the end turns these borders
    /// into counts. The cost is that of the outlines, not of the areas. The sums wrap on the way;
    /// the result does not.
    fn cast_chunk(frame: GridFrame, views: &[ScanView], settings: &CastSettings) -> Self {
        let (mut hits, mut misses) = (vec![0_u16; frame.len()], vec![0_u16; frame.len()]);
        let band_rows = band_rows(&frame);
        let band_len = (band_rows * frame.width).max(1);
        for batch in views.chunks(BATCH) {
            let sweeps: Vec<Sweep> =
                batch.par_iter().map(|view| Sweep::new(view, &frame, settings)).collect();
            let bands = hits.par_chunks_mut(band_len).zip(misses.par_chunks_mut(band_len));
            bands.enumerate().for_each(|(i, (hits, misses))| {
                let rows = hits.len() / frame.width;
                let mut band =
                    Band { first: i * band_rows, rows, width: frame.width, hits, borders: misses };
                sweeps.iter().for_each(|sweep| band.add(sweep));
            });
        }
        misses.par_chunks_mut(band_len).for_each(|band| {
            band.chunks_mut(frame.width).for_each(sum_along_row);
        });
        HitMissCounts { frame, hits, misses }
    }
}

/// Turns borders into counts.
fn sum_along_row(row: &mut [u16]) {
    row.iter_mut().fold(0_u16, |sum, border| {
        *border = sum.wrapping_add(*border);
        *border
    });
}

fn add_saturating(sum: &mut [u16], part: &[u16]) {
    sum.iter_mut().zip(part).for_each(|(s, p)| *s = s.saturating_add(*p));
}

/// A few whole rows of the grid.
struct Band<'a> {
    first: usize,
    rows: usize,
    width: usize,
    hits: &'a mut [u16],
    borders: &'a mut [u16],
}

impl Band<'_> {
    fn add(&mut self, sweep: &Sweep) {
        let (low, high) = (self.first as f64, (self.first + self.rows) as f64);
        if sweep.rows.1 < low || sweep.rows.0 > high {
            return;
        }
        let mut last = sweep.free[sweep.free.len() - 1];
        for &point in &sweep.free {
            self.add_border(last, point);
            last = point;
        }
        let mut start = 0;
        for &end in &sweep.chain_ends {
            let chain = &sweep.surface[start..end];
            chain.windows(2).for_each(|pair| self.add_chord(pair[0], pair[1]));
            self.add_point(chain[chain.len() - 1]);
            start = end;
        }
    }

    /// Rows of this band whose centres lie in `low <= y < high`.
    fn rows_between(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        let limit = self.rows as f64;
        let first = (low + 0.5 - self.first as f64).clamp(0.0, limit);
        let end = (high + 0.5 - self.first as f64).clamp(0.0, limit);
        first as usize..end as usize
    }

    /// One edge of a counter-clockwise polygon: free space lies to its left, so to the right of
    /// descending edges.
    fn add_border(&mut self, a: Vector2<f64>, b: Vector2<f64>) {
        let (low, high, step) = if a.y > b.y { (b, a, 1) } else { (a, b, u16::MAX) };
        if high.y < self.first as f64 || low.y > (self.first + self.rows) as f64 {
            return;
        }
        let rows = self.rows_between(low.y, high.y);
        let slope = (high.x - low.x) / (high.y - low.y);
        for row in rows {
            let x = low.x + ((self.first + row) as f64 + 0.5 - low.y) * slope;
            // The first cell whose centre is at or right of the edge.
            let column = (x.max(-0.5) + 0.5).min(self.width as f64) as usize;
            if column < self.width {
                let border = &mut self.borders[row * self.width + column];
                *border = border.wrapping_add(step);
            }
        }
    }

    /// Hits along a piece of wall, one cell per step of its longer axis, without the cell that
    /// the next piece begins in.
    fn add_chord(&mut self, a: Vector2<f64>, b: Vector2<f64>) {
        let (low, high) = (self.first as f64, (self.first + self.rows) as f64);
        if a.y.max(b.y) < low || a.y.min(b.y) >= high {
            return;
        }
        let d = b - a;
        let (major, minor) = if d.x.abs() >= d.y.abs() { (0, 1) } else { (1, 0) };
        let (from, to) = (a[major].floor(), b[major].floor());
        let slope = d[minor] / d[major];
        let direction = if to > from { 1.0 } else { -1.0 };
        for k in 0..(to - from).abs() as usize {
            let cell = from + direction * k as f64 + 0.5;
            let mut point = Vector2::zeros();
            point[major] = cell;
            // The centre of the first cell may lie before the chord's beginning.
            let along = (cell - a[major]) * direction;
            point[minor] = a[minor] + along.max(0.0) * direction * slope;
            self.add_point(point);
        }
    }

    fn add_point(&mut self, point: Vector2<f64>) {
        let (x, y) = (point.x, point.y - self.first as f64);
        if x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.rows as f64 {
            let hit = &mut self.hits[y as usize * self.width + x as usize];
            *hit = hit.saturating_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIDE: usize = 2 * 64 + 9;

    fn grid_of(sweep: &Sweep) -> (Vec<u16>, Vec<u16>) {
        let (mut hits, mut misses) = (vec![0; SIDE * SIDE], vec![0; SIDE * SIDE]);
        let band_len = 64 * SIDE;
        let bands = hits.chunks_mut(band_len).zip(misses.chunks_mut(band_len)).enumerate();
        for (i, (hits, borders)) in bands {
            let rows = hits.len() / SIDE;
            Band { first: i * 64, rows, width: SIDE, hits, borders }.add(sweep);
        }
        misses.chunks_mut(SIDE).for_each(sum_along_row);
        (hits, misses)
    }

    /// Does a ray to the right from `p` cross the polygon an odd number of times?
    fn inside(polygon: &[Vector2<f64>], p: Vector2<f64>) -> bool {
        let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
        let crossed = edges.filter(|(a, b)| {
            (a.y > p.y) != (b.y > p.y) && (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x > p.x
        });
        crossed.count() % 2 == 1
    }

    proptest! {
        #[test]
        fn polygons_cover_the_cells_whose_centres_they_hold(
            x in -30.0..170.0_f64,
            y in -30.0..170.0_f64,
            radii in prop::collection::vec(0.5..90.0_f64, 3..40),
        ) {
            let step = std::f64::consts::TAU / radii.len() as f64;
            let corner = |(k, r): (usize, &f64)| {
                let (s, c) = (step * k as f64 + 0.1).sin_cos();
                Vector2::new(x + r * c, y + r * s)
            };
            let free: Vec<_> = radii.iter().enumerate().map(corner).collect();
            let rows = (f64::NEG_INFINITY, f64::INFINITY);
            let sweep = Sweep { free, surface: vec![], chain_ends: vec![], rows };
            let (_, misses) = grid_of(&sweep);
            for (i, miss) in misses.iter().enumerate() {
                let center = Vector2::new((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5);
                prop_assert_eq!(*miss == 1, inside(&sweep.free, center), "cell {}", i);
                prop_assert!(*miss <= 1);
            }
        }

        #[test]
        fn chords_hit_one_cell_per_step_and_nothing_off_the_line(
            ax in -20.0..160.0_f64, ay in -20.0..160.0_f64,
            bx in -20.0..160.0_f64, by in -20.0..160.0_f64,
        ) {
            let (a, b) = (Vector2::new(ax, ay), Vector2::new(bx, by));
            let rows = (ay.min(by), ay.max(by));
            let sweep = Sweep { free: vec![a], surface: vec![a, b], chain_ends: vec![2], rows };
            let (hits, _) = grid_of(&sweep);
            let normal = Vector2::new(a.y - b.y, b.x - a.x).normalize();
            for (i, _) in hits.iter().enumerate().filter(|(_, h)| **h > 0) {
                let center = Vector2::new((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5);
                prop_assert!(normal.dot(&(center - a)).abs() <= 0.5 * 2.0_f64.sqrt() + 1e-9);
            }
            let within = |p: Vector2<f64>| p.iter().all(|v| (0.0..SIDE as f64).contains(v));
            if within(a) && within(b) {
                let steps = (a.map(f64::floor) - b.map(f64::floor)).abs();
                let d = (b - a).abs();
                let expected = if d.x >= d.y { steps.x } else { steps.y } as u32 + 1;
                prop_assert_eq!(hits.iter().map(|h| u32::from(*h)).sum::<u32>(), expected);
            }
        }
    }
}
