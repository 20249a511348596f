use crate::PointCloud;
use geometry::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// The points of a cell as a normal distribution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distribution {
    pub mean: Vector2<f64>,
    pub covariance: Matrix2<f64>,
    /// Inverse of the covariance.
    pub information: Matrix2<f64>,
    /// Number of points.
    pub count: f64,
}

/// A cloud as normal distributions, in four grids shifted by half a cell.
#[derive(Default)]
pub(super) struct Cells {
    side_m: f64,
    pub distributions: Vec<Distribution>,
    grids: [BTreeMap<(i32, i32), usize>; 4],
}

#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    position: Vector2<f64>,
    square: Matrix2<f64>,
}

impl Cells {
    pub fn new(cloud: &PointCloud, side_m: f64, flatness: f64, min_points: usize) -> Self {
        let mut cells = Cells { side_m: side_m.max(1e-2), ..Cells::default() };
        for grid in 0..4 {
            let mut sums: BTreeMap<(i32, i32), Sums> = BTreeMap::new();
            for point in &cloud.points {
                let sum = sums.entry(cells.key(&point.position, grid)).or_default();
                sum.count += 1.0;
                sum.position += point.position;
                sum.square += point.position * point.position.transpose();
            }
            for (key, sum) in sums {
                let distribution = (sum.count >= min_points.max(3) as f64)
                    .then(|| sum.distribution(flatness))
                    .flatten();
                let Some(distribution) = distribution else { continue };
                cells.grids[grid].insert(key, cells.distributions.len());
                cells.distributions.push(distribution);
            }
        }
        cells
    }

    /// Indices of the up to four cells that a place lies in.
    pub fn at(&self, place: Vector2<f64>) -> impl Iterator<Item = usize> {
        let keys = [0, 1, 2, 3].map(|grid| self.key(&place, grid));
        self.grids.iter().zip(keys).filter_map(|(grid, key)| grid.get(&key).copied())
    }

    /// `exp(-r^T B r / 2)` of the cell that explains a place best; 0 outside all cells.
    pub fn fit(&self, place: Vector2<f64>) -> f64 {
        let distance2 = |cell: &Distribution| {
            let r = place - cell.mean;
            r.dot(&(cell.information * r))
        };
        let fits = self.at(place).map(|i| (-0.5 * distance2(&self.distributions[i])).exp());
        fits.fold(0.0, f64::max)
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
        let variances = eigen.eigenvalues.map(|v| v.max(flatness * largest).max(1e-6));
        let v = eigen.eigenvectors;
        let rebuilt = |d: Vector2<f64>| v * Matrix2::from_diagonal(&d) * v.transpose();
        Some(Distribution {
            mean,
            covariance: rebuilt(variances),
            information: rebuilt(variances.map(f64::recip)),
            count: self.count,
        })
    }
}
