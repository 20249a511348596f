use crate::PointCloud;
use geometry::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Mean and inverse covariance.
type Distribution = (Vector2<f64>, Matrix2<f64>);

/// The reference as normal distributions, in four grids shifted by half a cell.
#[derive(Default)]
pub(super) struct Cells {
    side_m: f64,
    grids: [BTreeMap<(i32, i32), Distribution>; 4],
}

#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    position: Vector2<f64>,
    square: Matrix2<f64>,
}

impl Cells {
    pub fn new(reference: &PointCloud, side_m: f64, flatness: f64, min_points: usize) -> Self {
        let mut cells = Cells { side_m: side_m.max(1e-2), ..Cells::default() };
        for grid in 0..4 {
            let mut sums: BTreeMap<(i32, i32), Sums> = BTreeMap::new();
            for point in &reference.points {
                let sum = sums.entry(cells.key(&point.position, grid)).or_default();
                sum.count += 1.0;
                sum.position += point.position;
                sum.square += point.position * point.position.transpose();
            }
            let enough = |sum: &Sums| sum.count >= min_points.max(3) as f64;
            cells.grids[grid] = sums
                .into_iter()
                .filter(|(_, sum)| enough(sum))
                .filter_map(|(key, sum)| Some((key, sum.distribution(flatness)?)))
                .collect();
        }
        cells
    }

    /// Mean and inverse covariance of the up to four cells that a place lies in.
    pub fn at(&self, place: &Vector2<f64>) -> impl Iterator<Item = Distribution> {
        let keys = [0, 1, 2, 3].map(|grid| self.key(place, grid));
        self.grids.iter().zip(keys).filter_map(|(grid, key)| grid.get(&key).copied())
    }

    fn key(&self, place: &Vector2<f64>, grid: usize) -> (i32, i32) {
        let shift = Vector2::new((grid & 1) as f64, (grid >> 1) as f64) * 0.5;
        let p = place / self.side_m + shift;
        (p.x.floor() as i32, p.y.floor() as i32)
    }
}

impl Sums {
    /// `None` for points that are all in one place.
    fn distribution(&self, flatness: f64) -> Option<Distribution> {
        let mean = self.position / self.count;
        let scatter = self.square / self.count - mean * mean.transpose();
        let covariance = scatter * (self.count / (self.count - 1.0));
        let eigen = (0.5 * (covariance + covariance.transpose())).symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        if largest.is_nan() || largest < 1e-8 {
            return None;
        }
        let inverse = eigen.eigenvalues.map(|v| 1.0 / v.max(flatness * largest).max(1e-6));
        let v = eigen.eigenvectors;
        Some((mean, v * Matrix2::from_diagonal(&inverse) * v.transpose()))
    }
}
