use super::cells::Cells;
use super::distribution::Distribution;
use super::newton::Cost;
use super::{Doubt, FAR, Score};
use crate::PointCloud;
use geometry::{Matrix2, Matrix3, Pose2, Vector2, Vector3};
use nalgebra::{Matrix2x3, Matrix3x2};

/// Distributions to distributions (Stoyanov et al. 2012):
/// `-sum n_i exp(-(d2 / 2) m^T (S_j + R S_i R^T)^-1 m)` over cells `i` of the scan and `j` of the
/// reference, `m` from the mean of one to that of the other. A cell of the scan counts for its
/// points, `n_i`, so that the cost is that of points to distributions with the points summed up.
pub(super) struct Distributions<'a> {
    pub cells: Cells,
    pub reference: &'a PointCloud,
    pub scan_cells: Cells,
    pub scan: &'a PointCloud,
    /// `d2`.
    pub softness: f64,
    pub range_std_m: f64,
}

/// A pair of cells at a pose.
struct CellPair {
    scan: usize,
    reference: usize,
    /// `exp(-(d2 / 2) q)`.
    fit: f64,
    /// Derivatives of the squared distance `q`.
    slope: Vector3<f64>,
    curve: Matrix3<f64>,
    /// How the slope follows `m`.
    pull: Matrix3x2<f64>,
    /// What the pair tells of a displacement.
    observed: Matrix3<f64>,
}

impl Distributions<'_> {
    fn pairs(&self, pose: &Pose2) -> impl Iterator<Item = CellPair> {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let shift = pose.translation();
        self.scan_cells.distributions.iter().enumerate().flat_map(move |(scan, cell)| {
            let turned = Distribution {
                mean: rotation * cell.mean,
                covariance: rotation * cell.covariance * rotation.transpose(),
                ..*cell
            };
            self.cells.at(turned.mean + shift).filter_map(move |reference| {
                let target = &self.cells.distributions[reference];
                self.pair((scan, reference), &turned, shift, target)
            })
        })
    }

    /// Squared distance `q = m^T B m` with its derivatives by `(x, y, yaw)`; `B` turns with the
    /// scan: `dB = -B Z B` with `Z = J S + S J^T`, `S` the scan's turned covariance.
    fn pair(
        &self,
        (scan, reference): (usize, usize),
        cell: &Distribution,
        shift: Vector2<f64>,
        target: &Distribution,
    ) -> Option<CellPair> {
        let b = (target.covariance + cell.covariance).try_inverse()?;
        let j = Matrix2::new(0.0, -1.0, 1.0, 0.0);
        let m = cell.mean + shift - target.mean;
        let q = m.dot(&(b * m));
        if self.softness * q > FAR {
            return None;
        }
        let d = [Vector2::x(), Vector2::y(), j * cell.mean];
        let z = j * cell.covariance + cell.covariance * j.transpose();
        let zz = j * z + z * j.transpose();
        let v = b * m;
        let (zv, bzv) = (z * v, b * (z * v));
        let yaw = |axis: usize| if axis == 2 { 1.0 } else { 0.0 };
        let mut slope = Vector3::from(d.map(|d| 2.0 * v.dot(&d)));
        slope.z -= v.dot(&zv);
        let mut curve = Matrix3::zeros();
        for (a, da) in d.iter().enumerate() {
            for (c, dc) in d.iter().enumerate() {
                curve[(a, c)] = 2.0 * da.dot(&(b * dc))
                    - 2.0 * yaw(c) * bzv.dot(da)
                    - 2.0 * yaw(a) * bzv.dot(dc);
            }
        }
        curve[(2, 2)] += 2.0 * zv.dot(&bzv) - v.dot(&(zz * v)) - 2.0 * v.dot(&cell.mean);
        let fit = (-0.5 * self.softness * q).exp();
        let pull = Matrix3x2::from_fn(|a, c| 2.0 * (b * d[a])[c] - 2.0 * yaw(a) * bzv[c]);
        let derivative = Matrix2x3::from_columns(&d);
        let observed = derivative.transpose() * target.observed * derivative;
        Some(CellPair { scan, reference, fit, slope, curve, pull, observed })
    }
}

impl Score for Distributions<'_> {
    fn cost(&self, pose: &Pose2) -> Cost {
        let mut cost = Cost::default();
        let half = 0.5 * self.softness;
        for pair in self.pairs(pose) {
            let weight = self.scan_cells.distributions[pair.scan].count;
            let e = weight * pair.fit;
            cost.value -= e;
            cost.g += pair.slope * (half * e);
            let outer = pair.slope * pair.slope.transpose();
            cost.h += (pair.curve - outer * half) * (half * e);
            cost.observed += pair.observed * e;
        }
        cost
    }

    /// The spread of the gradient that errors of the ranges make, through the means of the cells
    /// that a point lies in (Censi, ICRA 2007): neighbouring cells share points.
    fn doubt(&self, pose: &Pose2) -> Doubt {
        let half = 0.5 * self.softness;
        let mut scan_pull = vec![Matrix3x2::zeros(); self.scan_cells.distributions.len()];
        let mut reference_pull = vec![Matrix3x2::zeros(); self.cells.distributions.len()];
        for pair in self.pairs(pose) {
            let count = self.scan_cells.distributions[pair.scan].count;
            let pull = pair.pull * (half * pair.fit);
            scan_pull[pair.scan] += pull;
            reference_pull[pair.reference] +=
                pull * (count / self.cells.distributions[pair.reference].count);
        }
        let (mut spread, mut explained) = (Matrix3::zeros(), 0);
        let mut add = |d: Vector3<f64>| spread += d * d.transpose();
        for point in &self.scan.points {
            let cells = self.scan_cells.at(point.position);
            let pull: Matrix3x2<f64> = cells.map(|cell| scan_pull[cell]).sum();
            explained += usize::from(self.cells.explain(pose.transform(point.position)));
            add(pull * pose.rotate(point.ray));
        }
        for point in &self.reference.points {
            let cells = self.cells.at(point.position);
            let pull: Matrix3x2<f64> = cells.map(|cell| reference_pull[cell]).sum();
            add(pull * point.ray);
        }
        Doubt { spread: spread * self.range_std_m.powi(2), explained }
    }

    fn weight(&self) -> f64 {
        self.scan_cells.distributions.iter().map(|cell| cell.count).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::distribution::Shape;
    use super::*;
    use crate::CloudPoint;

    /// Two walls at a right angle, not quite straight, from `offset` on.
    fn corner(offset: f64) -> PointCloud {
        let point = |i: u32| {
            let along = f64::from(i % 40) * 0.05 + offset;
            let bent = 0.02 * (7.0 * along).sin();
            let position =
                if i < 40 { Vector2::new(along, bent) } else { Vector2::new(bent, along) };
            CloudPoint {
                position,
                ray: position.normalize(),
                range: position.norm(),
                normal: None,
                normal_variance: 0.0,
                line_distance: 0.0,
                beam_step: 0.01,
                beam: i,
            }
        };
        PointCloud { points: (0..80).map(point).collect() }
    }

    #[test]
    fn derivatives_are_the_numeric_ones() {
        let (reference, scan) = (corner(0.1), corner(0.13));
        let [cells, scan_cells] = [(&reference, true), (&scan, false)].map(|(cloud, endless)| {
            let (side_m, flatness) = (1.0, 0.05);
            let shape = Shape { side_m, flatness, min_points: 3, endless, doublings: 1 };
            Cells::new(cloud, &shape)
        });
        let (reference, scan) = (&reference, &scan);
        let (softness, range_std_m) = (0.7, 0.01);
        let score = Distributions { cells, reference, scan_cells, scan, softness, range_std_m };
        let place = Vector3::new(0.02, -0.03, 0.04);
        let at = |x: Vector3<f64>| score.cost(&Pose2::new(x.x, x.y, x.z));
        let here = at(place);
        let step = 1e-6;
        for axis in 0..3 {
            let mut delta = Vector3::zeros();
            delta[axis] = step;
            let (after, before) = (at(place + delta), at(place - delta));
            let slope = (after.value - before.value) / (2.0 * step);
            assert!((slope - here.g[axis]).abs() < 1e-5 * here.g.norm(), "{slope} {}", here.g);
            let curve = (after.g - before.g) / (2.0 * step);
            let off = (curve - here.h.column(axis)).norm();
            assert!(off < 1e-5 * here.h.norm(), "{curve} {}", here.h);
        }
    }
}
