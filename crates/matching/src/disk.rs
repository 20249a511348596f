/// The cells within reach of a surfel, row by row, with their squared distances.
#[derive(Clone, Debug)]
pub(crate) struct Disk {
    /// In whole cells.
    pub radius: usize,
    /// Half the width of each row.
    half_widths: Vec<usize>,
    /// `[row][column]` over the square around the disk.
    squares: Vec<u32>,
}

impl Disk {
    pub fn new(reach: f32) -> Self {
        let reach = reach.clamp(1.0, 15.0);
        let radius = reach.floor() as usize;
        let side = 2 * radius + 1;
        let square = |i: usize| (i.abs_diff(radius) * i.abs_diff(radius)) as u32;
        let width = |v: usize| (reach * reach - square(v) as f32).max(0.0).sqrt().floor() as usize;
        let squares = (0..side * side).map(|i| square(i / side) + square(i % side)).collect();
        Disk { radius, half_widths: (0..side).map(width).collect(), squares }
    }

    /// Rows of the disk: index from the top, half width, squared distances over the whole side.
    pub fn rows(&self) -> impl Iterator<Item = (usize, usize, &[u32])> {
        let side = 2 * self.radius + 1;
        let rows = self.half_widths.iter().zip(self.squares.chunks(side));
        rows.enumerate().map(|(v, (&half, squares))| (v, half, squares))
    }
}
