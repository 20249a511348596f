mod look_up;

use crate::LinePoint;
use crate::disk::Disk;
use crate::surfel::{Moments, Surfel, UPPER};
use geometry::Pose2;
use look_up::LookUp;
use serde::{Deserialize, Serialize};

/// Surface orientations are kept apart in this many layers: normals towards +x, +y, -x, -y.
const LAYERS: usize = 4;
/// "No surfel in reach": farther than any, and no surfel's index.
const EMPTY: u32 = UPPER;
/// Squared distance in cells from a cell to those next to it, diagonally too.
const ADJACENT: u32 = 2;
/// Most surfels a field can hold.
const MOST_SURFELS: usize = u16::MAX as usize;
/// Most cells to a side of a window: with borders and layers 2^23 cells, so that their indices are
/// exact as `f32`.
const MOST_CELLS: f64 = 1446.0;
/// A surfel also enters the neighbouring layer when its normal has at least this component along
/// that layer's axis (75 degrees), so that a normal near a layer's border finds it from both sides.
const NEIGHBOUR_LAYER_COMPONENT: f32 = 0.26;

/// Size of a [`SurfelField`]'s cells and how far a surfel is felt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FieldSettings {
    /// Side of a cell, metres: the spacing of surfels on a wall.
    pub cell_m: f32,
    /// A point farther than this from every surfel has no correspondence, metres; at most 15 cells.
    pub reach_m: f32,
    /// Standard deviation of the map's surfaces about their local lines, metres: roughness, clutter
    /// and pose error of the patches, which do not average out.
    pub roughness_m: f32,
}

impl Default for FieldSettings {
    fn default() -> Self {
        FieldSettings { cell_m: 0.1, reach_m: 0.5, roughness_m: 0.01 }
    }
}

/// A map of surfels with, for every cell around them, the nearest one: the reference of the fast
/// matcher, kept incrementally.
///
/// Surfels average all points that fell into one cell with like orientation, so a wall seen by many
/// scans is known better than by one. The field lives in one local frame and a fixed window;
/// points outside the window are ignored.
#[derive(Clone, Debug)]
pub struct SurfelField {
    settings: FieldSettings,
    min_x: f32,
    min_y: f32,
    width: usize,
    height: usize,
    /// `[layer][row][column]`: squared distance in cells to the nearest surfel (upper half, 0 only
    /// in a surfel's own cell and layer) and its index (lower half), so that the nearer one, and of
    /// two equally near the older, is the smaller number; `EMPTY` where none is in reach.
    cells: Vec<u32>,
    surfels: Vec<Surfel>,
    moments: Vec<Moments>,
    /// Cells within reach of a surfel.
    disk: Disk,
}

impl SurfelField {
    /// An empty field over `[min, max]` (metres, in the field's frame).
    pub fn new(settings: FieldSettings, min: (f64, f64), max: (f64, f64)) -> Self {
        let mut field = SurfelField {
            settings,
            min_x: 0.0,
            min_y: 0.0,
            width: 0,
            height: 0,
            cells: Vec::new(),
            surfels: Vec::new(),
            moments: Vec::new(),
            disk: Disk::new(settings.reach_m / settings.cell_m),
        };
        field.reset(min, max);
        field
    }

    /// Empties the field and moves its window, reusing memory. Of a window of more than
    /// 1446 cells to a side the middle is kept.
    pub fn reset(&mut self, min: (f64, f64), max: (f64, f64)) {
        let cell = f64::from(self.settings.cell_m);
        let axis = |min: f64, max: f64| {
            let cells = ((max - min) / cell).ceil().max(1.0);
            let kept = cells.min(MOST_CELLS);
            let left_out = 0.5 * (cells - kept) * cell;
            // One more cell on each side: the border.
            ((min + left_out - cell) as f32, kept as usize + 2)
        };
        (self.min_x, self.width) = axis(min.0, max.0);
        (self.min_y, self.height) = axis(min.1, max.1);
        let cells = LAYERS * self.width * self.height;
        self.cells.clear();
        self.cells.resize(cells, EMPTY);
        self.surfels.clear();
        self.moments.clear();
        // Index 0 is that of an empty cell.
        self.surfels.push(Surfel::ABSENT);
        self.moments.push(Moments::default());
    }

    /// Number of surfels.
    pub fn surfel_count(&self) -> usize {
        self.surfels.len() - 1
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &FieldSettings {
        &self.settings
    }

    /// Adds a scan's points, seen from `field_from_scan`.
    pub fn insert(&mut self, points: &[LinePoint], field_from_scan: &Pose2) {
        let moved = LinePoint::mover(field_from_scan);
        for p in points {
            self.insert_point(&moved(p));
        }
    }

    fn insert_point(&mut self, p: &LinePoint) {
        let LinePoint { x, y, nx, ny, variance, .. } = *p;
        let normal_variance = p.normal_variance.max(1e-5);
        let Some((column, row)) = self.cell_of(x, y) else { return };
        let (layer, neighbour_layer) = layers_of(nx, ny);
        let weight = 1.0 / variance;
        let (id, is_new) = if let Some(id) = self.surfel_through(p, layer, column, row) {
            (id, false)
        } else if self.surfels.len() < MOST_SURFELS {
            self.surfels.push(Surfel::ABSENT);
            self.moments.push(Moments::default());
            (self.surfels.len() - 1, true)
        } else {
            return;
        };
        let m = &mut self.moments[id];
        m.weight += weight;
        m.x += weight * x;
        m.y += weight * y;
        let normal_weight = 1.0 / normal_variance;
        m.normal_weight += normal_weight;
        m.nx += normal_weight * nx;
        m.ny += normal_weight * ny;
        self.surfels[id] = m.line(self.settings.roughness_m);
        if is_new {
            self.spread(id, layer, column, row, 0);
            if let Some(neighbour) = neighbour_layer {
                self.spread(id, neighbour, column, row, 1);
            }
        }
    }

    /// The surfel that a point belongs to: the one in its own cell, else the one next to it in an
    /// adjacent cell whose line it continues. Without the latter a wall along a border of cells
    /// would fall into two rows of surfels, each of them of the noise's near or far half only, and
    /// points would be drawn to their own half.
    fn surfel_through(
        &self,
        p: &LinePoint,
        layer: usize,
        column: usize,
        row: usize,
    ) -> Option<usize> {
        let own = self.cells[self.index(layer, column, row)];
        if is_home(own) {
            return Some(index_in(own));
        }
        let mut best: Option<(f32, usize)> = None;
        for v in row - 1..row + 2 {
            let (first, last) =
                (self.index(layer, column - 1, v), self.index(layer, column + 1, v));
            for &cell in self.cells[first..=last].iter().filter(|cell| is_home(**cell)) {
                let id = index_in(cell);
                let [across, along] = self.offset_from(id, p.x, p.y).map(f32::abs);
                if across < 0.5 * self.settings.cell_m
                    && along < self.settings.cell_m
                    && best.is_none_or(|b| along < b.0)
                {
                    best = Some((along, id));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// How far a point lies from a surfel, across its line and along it, metres.
    fn offset_from(&self, id: usize, x: f32, y: f32) -> [f32; 2] {
        let (m, (nx, ny)) = (&self.moments[id], self.surfels[id].normal());
        let (dx, dy) = (x - m.x / m.weight, y - m.y / m.weight);
        [nx * dx + ny * dy, nx * dy - ny * dx]
    }

    /// Makes surfel `id` the nearest one in every cell it is nearer to than the present one; it
    /// counts as at least `at_least` away.
    fn spread(&mut self, id: usize, layer: usize, column: usize, row: usize, at_least: u32) {
        let radius = self.disk.radius;
        for (dv, half, squares) in self.disk.rows() {
            let Some(v) = (row + dv).checked_sub(radius).filter(|v| self.inner_rows().contains(v))
            else {
                continue;
            };
            let first = column.saturating_sub(half).max(1);
            let last = (column + half).min(self.width - 2);
            let squares = &squares[first + radius - column..=last + radius - column];
            let start = self.index(layer, first, v);
            let cells = &mut self.cells[start..=start + last - first];
            for (cell, &square) in cells.iter_mut().zip(squares) {
                *cell = (*cell).min((square.max(at_least) << 16) | id as u32);
            }
        }
    }

    /// True when a surface of the map that faces the viewer lies between `from` and `to` (field
    /// frame). Surfels reach `half_length_m` to each side: a whole cell leaves no gaps in walls and
    /// makes openings narrower by that, less does the opposite.
    pub fn blocks(&self, from: (f32, f32), to: (f32, f32), half_length_m: f32) -> bool {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let length = (dx * dx + dy * dy).sqrt();
        // No line of sight inside the window is longer than its sides together.
        let longest = (self.width + self.height) as f32;
        let steps = (length / self.settings.cell_m).min(longest) as usize;
        let (ux, uy) = (dx / length.max(1e-6), dy / length.max(1e-6));
        let layer = layer_of(-ux, -uy);
        let cell_m = self.settings.cell_m;
        (1..steps).any(|k| {
            let d = k as f32 * self.settings.cell_m;
            let (x, y) = (from.0 + ux * d, from.1 + uy * d);
            let Some((column, row)) = self.cell_of(x, y) else { return false };
            let cell = self.cells[self.index(layer, column, row)];
            cell >> 16 <= ADJACENT
                && self.surfels.get(index_in(cell)).is_some_and(|s| {
                    let (nx, ny) = s.normal();
                    let approach = nx * ux + ny * uy;
                    let [across, along] = self.offset_from(index_in(cell), x, y);
                    // Where the line of sight meets the surfel's line, seen from here.
                    let ahead = -across / approach;
                    let along = along + ahead * (nx * uy - ny * ux);
                    approach < -0.5 && ahead.abs() <= cell_m && along.abs() <= half_length_m
                })
        })
    }

    /// The cell of a point, if it lies in the window.
    fn cell_of(&self, x: f32, y: f32) -> Option<(usize, usize)> {
        let inverse = 1.0 / self.settings.cell_m;
        let u = (x - self.min_x) * inverse;
        let v = (y - self.min_y) * inverse;
        let (right, top) = ((self.width - 1) as f32, (self.height - 1) as f32);
        let inside = u >= 1.0 && v >= 1.0 && u < right && v < top;
        inside.then_some((u as usize, v as usize))
    }

    fn inner_rows(&self) -> std::ops::Range<usize> {
        1..self.height - 1
    }

    fn index(&self, layer: usize, column: usize, row: usize) -> usize {
        (layer * self.height + row) * self.width + column
    }

    /// What a look-up of nearest surfels needs, for points that are yet to be moved by `(tx, ty)`.
    #[inline(always)]
    pub(crate) fn look_up(&self, tx: f32, ty: f32) -> LookUp<'_> {
        let inverse = 1.0 / self.settings.cell_m;
        let stride = self.width as f32;
        LookUp {
            cells: &self.cells,
            surfels: &self.surfels,
            inverse,
            x0: (tx - self.min_x) * inverse,
            y0: (ty - self.min_y) * inverse,
            right: (self.width - 1) as f32,
            top: (self.height - 1) as f32,
            stride,
            layer: stride * self.height as f32,
        }
    }
}

/// The layer of a normal: the axis direction it is nearest to.
#[inline(always)]
fn layer_of(nx: f32, ny: f32) -> usize {
    let upright = usize::from(nx.abs() < ny.abs());
    let along = if upright == 1 { ny } else { nx };
    upright + 2 * usize::from(along < 0.0)
}

/// The layer of a normal and the next one if the normal is not far from it.
fn layers_of(nx: f32, ny: f32) -> (usize, Option<usize>) {
    let layer = layer_of(nx, ny);
    let (along, positive, negative) = if layer.is_multiple_of(2) { (ny, 1, 3) } else { (nx, 0, 2) };
    let neighbour = if along >= 0.0 { positive } else { negative };
    (layer, (along.abs() >= NEIGHBOUR_LAYER_COMPONENT).then_some(neighbour))
}

/// True for the cell and layer a surfel lies in.
fn is_home(cell: u32) -> bool {
    cell >> 16 == 0
}

/// The index of a cell's nearest surfel; no surfel's for an empty cell.
#[inline(always)]
fn index_in(cell: u32) -> usize {
    (cell & 0xffff) as usize
}
