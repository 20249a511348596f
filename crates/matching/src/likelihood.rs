use crate::PointCloud;
use geometry::{Pose2, Vector2};
use serde::{Deserialize, Serialize};

/// How a reference cloud becomes a [`LikelihoodPyramid`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LikelihoodSettings {
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Standard deviation of the blur around each reference point, metres: half a cell of rounding,
    /// half a step of yaw, sensor noise and what the reference is bent by.
    pub sigma_m: f64,
    /// Longest side of the grid, metres; reference points outside of a square of this side around
    /// their median are left out.
    pub extent_m: f64,
    /// The coarsest level, of windows of `2^level` cells: no need for windows larger than what is
    /// searched. At most [`LikelihoodPyramid::TOP_LEVEL`].
    pub levels: u8,
}

impl Default for LikelihoodSettings {
    fn default() -> Self {
        LikelihoodSettings {
            cell_m: 0.05,
            sigma_m: 0.08,
            extent_m: 120.0,
            levels: LikelihoodPyramid::TOP_LEVEL as u8,
        }
    }
}

/// The likelihood of a scan point at every cell of a grid around a reference cloud, and upper
/// bounds of it over windows of 2, 4, ... cells: the tables of the correlative matcher (Olson,
/// "Real-time correlative scan matching", 2009) and of branch and bound (Hess et al., "Real-time
/// loop closure in 2D lidar SLAM", 2016).
///
/// The likelihood of a point at distance `d` from the nearest reference point is
/// `exp(-d^2 / (2 sigma^2))`, kept as `0..=255`.
#[derive(Clone, Debug)]
pub struct LikelihoodPyramid {
    cell: f64,
    /// Lower corner of cell (0, 0) in the reference frame.
    origin: Vector2<f64>,
    width: i32,
    height: i32,
    stride: i32,
    /// `levels[h]`, at the cell where a window of `2^h x 2^h` cells begins: its maximum. Rows and
    /// columns run from `-pad` to `height` and to `width + pad`, so that windows may begin outside.
    levels: Vec<Vec<u8>>,
    /// Cells around the grid at which windows may begin: the size of the largest window.
    pad: i32,
}

impl LikelihoodPyramid {
    /// The coarsest level there may be: windows of `2^7 = 128` cells (6.4 m at 5 cm).
    pub const TOP_LEVEL: usize = 7;

    /// The pyramid of a reference cloud. Points that are not finite are left out.
    pub fn build(reference: &PointCloud, settings: &LikelihoodSettings) -> Self {
        Self::from_points(reference.points.iter().map(|p| p.position), settings)
    }

    /// The pyramid of points in the reference frame.
    pub fn from_points(
        points: impl IntoIterator<Item = Vector2<f64>>,
        settings: &LikelihoodSettings,
    ) -> Self {
        let cell = settings.cell_m.max(1e-3);
        let points = within_extent(points, settings.extent_m.clamp(cell, 4000.0 * cell));
        let kernel = Kernel::new(settings.sigma_m / cell);
        let (lo, hi) = bounds(&points);
        let margin = f64::from(kernel.radius + 1) * cell;
        let origin = lo.add_scalar(-margin);
        let cells = |d: f64| (d / cell) as i32 + 2 * (kernel.radius + 1) + 1;
        let (width, height) = (cells(hi.x - lo.x), cells(hi.y - lo.y));
        let top = usize::from(settings.levels).min(Self::TOP_LEVEL);
        let pad = 1 << top;
        let stride = width + 2 * pad;
        let rows = height + pad;
        let mut pyramid = LikelihoodPyramid {
            cell,
            origin,
            width,
            height,
            stride,
            levels: vec![vec![0; (stride * rows) as usize]],
            pad,
        };
        pyramid.stamp_points(&points, &kernel);
        for level in 0..top {
            let next = window_maximum(&pyramid.levels[level], 1 << level, stride as usize);
            pyramid.levels.push(next);
        }
        pyramid
    }

    /// Mean likelihood (0 to 1) of scan points at `reference_from_scan`: the quantity searched for.
    pub fn score(&self, points: &[Vector2<f32>], reference_from_scan: &Pose2) -> f32 {
        let sum: u32 = points
            .iter()
            .map(|p| {
                let (x, y) = self.cell_of(&reference_from_scan.transform(p.cast::<f64>()));
                u32::from(self.value(0, x, y))
            })
            .sum();
        sum as f32 / (255.0 * points.len().max(1) as f32)
    }

    /// Side of a cell, metres.
    pub fn cell_m(&self) -> f64 {
        self.cell
    }

    /// The coarsest level it has.
    pub(crate) fn top_level(&self) -> usize {
        self.levels.len() - 1
    }

    /// Bytes of all levels.
    pub fn memory_bytes(&self) -> usize {
        self.levels.iter().map(Vec::len).sum()
    }

    /// A point of the reference frame in cells from the grid's corner.
    pub(crate) fn in_cells(&self, point: &Vector2<f64>) -> Vector2<f64> {
        (point - self.origin) / self.cell
    }

    /// The cell that contains a point of the reference frame; far points saturate.
    pub(crate) fn cell_of(&self, point: &Vector2<f64>) -> (i32, i32) {
        let c = self.in_cells(point);
        const FAR: f64 = 1e8;
        (c.x.floor().clamp(-FAR, FAR) as i32, c.y.floor().clamp(-FAR, FAR) as i32)
    }

    /// Maximum over the window of `2^level` cells that begins at `(x, y)`; 0 outside of the grid.
    #[inline]
    pub(crate) fn value(&self, level: usize, x: i32, y: i32) -> u8 {
        let pad = self.pad;
        if x < -pad || x >= self.width + pad || y < -pad || y >= self.height {
            return 0;
        }
        self.levels[level][((y + pad) * self.stride + x + pad) as usize]
    }

    /// One level's bytes, for lookups by [`LikelihoodPyramid::linear`] index.
    pub(crate) fn level(&self, level: usize) -> &[u8] {
        &self.levels[level]
    }

    /// Index of the window that begins at `(x, y)`, where `x` is in [`LikelihoodPyramid::columns`].
    /// Rows outside of the grid give an index outside of the level, which reads as 0.
    pub(crate) fn linear(&self, x: i32, y: i32) -> i32 {
        let (row, column) = (y.saturating_add(self.pad), x.saturating_add(self.pad));
        row.saturating_mul(self.stride).saturating_add(column)
    }

    /// The columns at which windows may begin without their index running into another row.
    pub(crate) fn columns(&self) -> std::ops::Range<i32> {
        -self.pad..self.width + self.pad
    }

    /// Cells from one row to the next.
    pub(crate) fn stride(&self) -> i32 {
        self.stride
    }

    /// Writes the blurred points into level 0; each occupied cell once.
    fn stamp_points(&mut self, points: &[Vector2<f64>], kernel: &Kernel) {
        let mut cells: Vec<(i32, i32)> = points
            .iter()
            .map(|p| {
                let (x, y) = self.cell_of(p);
                (y, x)
            })
            .collect();
        cells.sort_unstable();
        cells.dedup();
        for (y, x) in cells {
            for (row, values) in (y - kernel.radius..).zip(kernel.rows()) {
                let start = self.linear(x - kernel.radius, row) as usize;
                let target = &mut self.levels[0][start..start + values.len()];
                for (t, v) in target.iter_mut().zip(values) {
                    *t = (*t).max(*v);
                }
            }
        }
    }
}

/// The blur around one point, in cells.
struct Kernel {
    radius: i32,
    values: Vec<u8>,
}

impl Kernel {
    /// Likelihoods below 1 % are dropped; wide blurs are cut at 60 cells.
    fn new(sigma: f64) -> Self {
        let sigma = sigma.clamp(1e-3, 20.0);
        let radius = (3.0 * sigma).floor() as i32;
        let mut values = Vec::new();
        for y in -radius..=radius {
            for x in -radius..=radius {
                let d2 = f64::from(x * x + y * y);
                values.push((255.0 * (-0.5 * d2 / (sigma * sigma)).exp()).round() as u8);
            }
        }
        Kernel { radius, values }
    }

    fn rows(&self) -> impl Iterator<Item = &[u8]> {
        self.values.chunks_exact(2 * self.radius as usize + 1)
    }
}

/// From windows of `size` cells to windows of `2 size`: the maximum of four.
fn window_maximum(level: &[u8], size: usize, stride: usize) -> Vec<u8> {
    let [right, below] = [size, size * stride].map(|shift| &level[shift.min(level.len())..]);
    let below_right = &level[(size * stride + size).min(level.len())..];
    let mut next = Vec::with_capacity(level.len());
    let four = level.iter().zip(right).zip(below.iter().zip(below_right));
    next.extend(four.map(|((&a, &b), (&c, &d))| a.max(b).max(c.max(d))));
    // The last rows have nothing below them.
    let two = level[next.len()..].iter().zip(&right[next.len()..]);
    next.extend(two.map(|(&a, &b)| a.max(b)));
    next.extend_from_slice(&level[next.len()..]);
    next
}

/// The finite points within a square of side `extent` around the median.
pub(crate) fn within_extent(
    points: impl IntoIterator<Item = Vector2<f64>>,
    extent: f64,
) -> Vec<Vector2<f64>> {
    let mut points: Vec<_> =
        points.into_iter().filter(|p| p.x.is_finite() && p.y.is_finite()).collect();
    let (lo, hi) = bounds(&points);
    if (hi - lo).max() > extent {
        let median = |axis: usize| {
            let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        let centre = Vector2::new(median(0), median(1));
        points.retain(|p| (p - centre).amax() <= 0.5 * extent);
    }
    points
}

fn bounds(points: &[Vector2<f64>]) -> (Vector2<f64>, Vector2<f64>) {
    let Some(first) = points.first() else {
        return (Vector2::zeros(), Vector2::zeros());
    };
    points.iter().fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(n: usize) -> Vec<Vector2<f64>> {
        let wave = |k: usize, f: f64| (k as f64 * f).sin();
        (0..n).map(|k| Vector2::new(4.0 * wave(k, 1.7), 3.0 * wave(k, 2.3))).collect()
    }

    #[test]
    fn every_level_is_the_maximum_over_its_window() {
        let pyramid = LikelihoodPyramid::from_points(scattered(60), &LikelihoodSettings::default());
        for level in 1..=LikelihoodPyramid::TOP_LEVEL {
            let size = 1 << level;
            for (x, y) in [(-120, -100), (-3, 5), (10, 20), (100, 60), (170, 110), (0, -1)] {
                let brute = (y..y + size)
                    .flat_map(|v| (x..x + size).map(move |u| (u, v)))
                    .map(|(u, v)| pyramid.value(0, u, v))
                    .max();
                assert_eq!(Some(pyramid.value(level, x, y)), brute, "level {level} at {x} {y}");
            }
        }
    }

    #[test]
    fn level_zero_is_the_blur_of_the_nearest_point() {
        let settings = LikelihoodSettings::default();
        let points = scattered(40);
        let pyramid = LikelihoodPyramid::from_points(points.clone(), &settings);
        let cells: Vec<_> = points.iter().map(|p| pyramid.cell_of(p)).collect();
        for y in 0..pyramid.height {
            for x in 0..pyramid.width {
                let d2 = cells.iter().map(|c| (c.0 - x).pow(2) + (c.1 - y).pow(2)).min().unwrap();
                let exact = (-0.5 * f64::from(d2) * (0.05f64 / 0.08).powi(2)).exp();
                let kept = f64::from(pyramid.value(0, x, y)) / 255.0;
                assert!((exact - kept).abs() < 0.012, "{x} {y}: {exact} {kept}");
            }
        }
    }

    #[test]
    fn garbage_points_are_left_out() {
        let mut points = scattered(30);
        points.push(Vector2::new(f64::NAN, 0.0));
        points.push(Vector2::new(1e30, -1e30));
        let pyramid = LikelihoodPyramid::from_points(points, &LikelihoodSettings::default());
        assert!(pyramid.memory_bytes() < 8 << 20);
        let empty = LikelihoodPyramid::from_points([], &LikelihoodSettings::default());
        assert_eq!(empty.score(&[Vector2::new(0.0, 0.0)], &Pose2::IDENTITY), 0.0);
    }
}
