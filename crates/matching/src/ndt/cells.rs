use super::distribution::{Distribution, Shape, Sums};
use super::table::{NONE, Table};
use crate::{CloudPoint, PointCloud};
use geometry::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// A cloud as normal distributions, in four grids shifted by half a cell: every block of two by two
/// quarters is a cell, and a place lies in the four that share its quarter.
#[derive(Default)]
pub(super) struct Cells {
    quarters_per_m: f64,
    pub distributions: Vec<Distribution>,
    table: Table,
    /// Larger cells of the points that are too few for one of these.
    larger: Option<Box<Cells>>,
    /// Index of their first distribution.
    first_larger: usize,
}

/// A point so close to a cell's distribution, metres, is explained by it ...
const CLOSE_M: f64 = 0.02;
/// ... with the distribution's own width, within three standard deviations.
const EXPLAINED: f64 = 9.0;

impl Cells {
    pub fn new(cloud: &PointCloud, shape: &Shape) -> Self {
        let quarters_per_m = 2.0 / shape.side_m.max(1e-2);
        let mut cells = Cells { quarters_per_m, ..Cells::default() };
        let mut quarters: BTreeMap<(i32, i32), Sums> = BTreeMap::new();
        for point in &cloud.points {
            quarters.entry(cells.quarter(&point.position)).or_default().add_point(point);
        }
        let mut blocks: BTreeMap<(i32, i32), Sums> = BTreeMap::new();
        for ((x, y), sums) in &quarters {
            for (dx, dy) in CORNERS {
                blocks.entry((x - dx, y - dy)).or_default().add(sums);
            }
        }
        let found = blocks.iter().filter_map(|(key, sums)| Some((key, sums.spread(shape)?)));
        let found: Vec<_> = found.collect();
        let mut across: Vec<f64> = found.iter().filter_map(|(_, s)| s.across()).collect();
        across.sort_by(f64::total_cmp);
        let common = across.get(across.len() / 2).copied().unwrap_or(0.0);
        cells.table = Table::for_quarters(4 * found.len());
        for (index, ((x, y), spread)) in found.into_iter().enumerate() {
            for (corner, (dx, dy)) in CORNERS.into_iter().enumerate() {
                cells.table.insert((x + dx, y + dy), corner, index as u32);
            }
            cells.distributions.push(spread.distribution(shape, common));
        }
        cells.with_larger(cloud, shape)
    }

    /// Gives points without a cell larger ones.
    fn with_larger(mut self, cloud: &PointCloud, shape: &Shape) -> Self {
        let lone = |p: &&CloudPoint| self.at(p.position).next().is_none();
        let lone = PointCloud { points: cloud.points.iter().filter(lone).copied().collect() };
        if shape.doublings == 0 || lone.len() < shape.min_points.max(3) {
            return self;
        }
        let side_m = 2.0 * shape.side_m;
        let shape = Shape { side_m, doublings: shape.doublings - 1, ..*shape };
        let mut larger = Cells::new(&lone, &shape);
        self.first_larger = self.distributions.len();
        self.distributions.append(&mut larger.distributions);
        self.larger = Some(Box::new(larger));
        self
    }

    /// Indices of the up to four cells that a place lies in.
    pub fn at(&self, place: Vector2<f64>) -> impl Iterator<Item = usize> {
        let (mut level, mut first) = (self, 0);
        let mut found = self.table.cells(self.quarter(&place));
        while let (Some(larger), true) = (&level.larger, found == [NONE; 4]) {
            first += level.first_larger;
            found = larger.table.cells(larger.quarter(&place));
            level = larger;
        }
        let cells = found.into_iter().filter(|cell| *cell != NONE);
        cells.map(move |cell| first + cell as usize)
    }

    /// Whether a place is where a cell has points.
    pub fn explain(&self, place: Vector2<f64>) -> bool {
        let near = Matrix2::identity() * CLOSE_M.powi(2);
        self.at(place).any(|i| {
            let cell = &self.distributions[i];
            let r = place - cell.mean;
            let information = (cell.covariance + near).try_inverse();
            information.is_some_and(|information| r.dot(&(information * r)) < EXPLAINED)
        })
    }

    fn quarter(&self, place: &Vector2<f64>) -> (i32, i32) {
        let p = place * self.quarters_per_m;
        (p.x.floor() as i32, p.y.floor() as i32)
    }
}

/// The quarters of a cell from its first.
const CORNERS: [(i32, i32); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];
