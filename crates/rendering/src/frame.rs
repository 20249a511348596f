use crate::{RenderError, ScanView};
use geometry::{LieGroup, Vector2};
use std::collections::BTreeMap;

/// Where a grid lies in the map frame: square cells, row 0 at the bottom (smallest y).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridFrame {
    /// Lower-left corner of cell (0, 0) in the map frame, metres.
    pub origin: Vector2<f64>,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Number of columns, along map x.
    pub width: usize,
    /// Number of rows, along map y.
    pub height: usize,
}

impl GridFrame {
    /// Most cells a grid may have: 163 x 163 m at 1 cm, 1.4 GB while it is being cast.
    pub const MAX_CELLS: usize = 1 << 28;

    /// The smallest frame whose cells cover the box `min`..`max` (map frame, metres).
    ///
    /// Its origin is a whole multiple of the resolution, so that crops of one map line up.
    ///
    /// # Errors
    /// A bad resolution, a corner that is not finite, or too many cells.
    pub fn covering(
        min: Vector2<f64>,
        max: Vector2<f64>,
        resolution_m: f64,
    ) -> Result<Self, RenderError> {
        if !(resolution_m.is_finite() && resolution_m > 0.0) {
            return Err(RenderError::Resolution { resolution_m });
        }
        if !min.iter().chain(max.iter()).all(|v| v.is_finite()) {
            return Err(RenderError::NotFinite { what: "a corner of the area to draw".into() });
        }
        // A corner within a billionth of a cell of a cell border lies on it: rounding must not add
        // a row.
        let first = (min / resolution_m).map(|v| (v + 1e-9).floor());
        let cells = (max / resolution_m - first).map(|v| (v - 1e-9).ceil().max(1.0));
        if cells.x * cells.y > Self::MAX_CELLS as f64 {
            let (width, height, limit) = (cells.x, cells.y, Self::MAX_CELLS);
            return Err(RenderError::TooLarge { width, height, resolution_m, limit });
        }
        let (width, height) = (cells.x as usize, cells.y as usize);
        Ok(GridFrame { origin: first * resolution_m, resolution_m, width, height })
    }

    /// A frame around everything the scans hit and every laser position, plus a margin.
    ///
    /// Stray hits do not stretch it: half-metre squares with less than 1/20,000 of all hits (and
    /// with fewer than 2 where there are more than 2,000) are left out.
    ///
    /// # Errors
    /// As [`GridFrame::covering`], and [`RenderError::Empty`] without any view.
    pub fn around(
        views: &[ScanView],
        margin_m: f64,
        resolution_m: f64,
    ) -> Result<Self, RenderError> {
        let mut squares = BTreeMap::<(i64, i64), usize>::new();
        let mut total = 0;
        for (i, view) in views.iter().enumerate() {
            view.check(i)?;
            // Neighbouring hits mostly lie in one square: count runs.
            let mut run = ((0, 0), 0);
            for point in view.hits() {
                if square(point) != run.0 {
                    *squares.entry(run.0).or_default() += run.1;
                    run = (square(point), 0);
                }
                run.1 += 1;
                total += 1;
            }
            *squares.entry(run.0).or_default() += run.1;
        }
        let needed = (total / 20_000 + 1).max(if total > 2_000 { 2 } else { 1 });
        let lasers = views.iter().map(|v| square(v.map_from_laser.translation()));
        let seen = squares.iter().filter(|(_, n)| **n >= needed).map(|(k, _)| *k);
        let (mut min, mut max) =
            (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for (i, j) in seen.chain(lasers) {
            let corner = Vector2::new(i as f64, j as f64) * COARSE_M;
            min = min.inf(&corner);
            max = max.sup(&corner.add_scalar(COARSE_M));
        }
        if min.x > max.x {
            return Err(RenderError::Empty);
        }
        Self::covering(min.add_scalar(-margin_m), max.add_scalar(margin_m), resolution_m)
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// True for a frame without cells.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A point of the map frame in cell units: cell `(c, r)` covers `c..c+1`, `r..r+1`.
    pub fn cells_from_map(&self, point: Vector2<f64>) -> Vector2<f64> {
        (point - self.origin) / self.resolution_m
    }

    /// Centre of a cell in the map frame, metres.
    pub fn center(&self, column: usize, row: usize) -> Vector2<f64> {
        self.origin + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * self.resolution_m
    }

    /// Upper-right corner in the map frame, metres.
    pub fn upper_right(&self) -> Vector2<f64> {
        self.origin + Vector2::new(self.width as f64, self.height as f64) * self.resolution_m
    }
}

/// Side of the squares that decide how far a map reaches, metres.
const COARSE_M: f64 = 0.5;

fn square(point: Vector2<f64>) -> (i64, i64) {
    ((point.x / COARSE_M).floor() as i64, (point.y / COARSE_M).floor() as i64)
}

impl ScanView<'_> {
    /// Refuses a pose that is not finite.
    pub(crate) fn check(&self, index: usize) -> Result<(), RenderError> {
        if LieGroup::is_finite(&self.map_from_laser) {
            Ok(())
        } else {
            Err(RenderError::NotFinite { what: format!("the pose of scan {index}") })
        }
    }
}
