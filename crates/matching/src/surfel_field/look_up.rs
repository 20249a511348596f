use super::index_in;
use crate::point_blocks::{LANES, Turned};
use crate::surfel::Surfel;

/// A field as one linearisation reads it.
#[derive(Clone, Copy)]
pub(crate) struct LookUp<'a> {
    pub(super) cells: &'a [u32],
    pub(super) surfels: &'a [Surfel],
    /// Cells per metre, and the field's corner in cells.
    pub(super) inverse: f32,
    pub(super) x0: f32,
    pub(super) y0: f32,
    /// The border's last column and row.
    pub(super) right: f32,
    pub(super) top: f32,
    /// Cells to a row and to a layer.
    pub(super) stride: f32,
    pub(super) layer: f32,
}

impl LookUp<'_> {
    /// The surfel nearest to each point of a block, [`Surfel::ABSENT`] where none is in reach.
    #[inline(always)]
    pub fn nearest(&self, points: &Turned) -> [Surfel; LANES] {
        let cells = self.cells_of(points);
        let mut nearest = [Surfel::ABSENT; LANES];
        for (slot, &cell) in nearest.iter_mut().zip(&cells) {
            let cell = self.cells[cell as usize];
            *slot = self.surfels[index_in(cell)];
        }
        nearest
    }

    /// The cell, and by its normal the layer, of each point of a block; those outside of the window
    /// are drawn to its border, which is empty. Numbers below 2^23 all along, without branches and
    /// conversions, so that it becomes vector instructions.
    #[inline(always)]
    fn cells_of(&self, points: &Turned) -> [u32; LANES] {
        let mut cells = [0; LANES];
        for (k, cell) in cells.iter_mut().enumerate() {
            let column = whole(points.x[k] * self.inverse + self.x0, self.right);
            let row = whole(points.y[k] * self.inverse + self.y0, self.top);
            let (nx, ny) = (points.nx[k], points.ny[k]);
            let upright = nx.abs() < ny.abs();
            let along = if upright { ny } else { nx };
            let first = if upright { self.layer } else { 0.0 };
            let first = first + if along < 0.0 { 2.0 * self.layer } else { 0.0 };
            let index = first + row * self.stride + column;
            *cell = (index + UNITS).to_bits() & (UNITS_BITS - 1);
        }
        cells
    }
}

/// Numbers from here to twice this are one unit apart: 2^23.
const UNITS: f32 = 8_388_608.0;
const UNITS_BITS: u32 = 1 << 23;

/// The whole part of a number, 0 below zero and no more than `most`; of a whole number itself or
/// one less.
#[inline(always)]
fn whole(value: f32, most: f32) -> f32 {
    let value = if value > 0.5 { value } else { 0.5 };
    let value = if value < most { value } else { most };
    (value - 0.5) + UNITS - UNITS
}
