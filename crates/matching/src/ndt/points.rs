use super::cells::Cells;
use super::newton::Cost;
use super::{Doubt, FAR, Score};
use crate::PointCloud;
use geometry::{Matrix2, Matrix3, Pose2, Vector2, Vector3};
use nalgebra::Matrix2x3;

/// Points to distributions (Biber and Strasser 2003): `-sum exp(-(d2 / 2) r^T B r)` over the scan's
/// points and the reference's cells, `r` from a cell's mean to a point.
pub(super) struct Points<'a> {
    pub cells: Cells,
    pub scan: &'a PointCloud,
    /// One point of so many is looked at.
    pub every: usize,
    /// `d2`.
    pub softness: f64,
}

impl Points<'_> {
    /// What one point adds.
    fn at_point(&self, turned: Vector2<f64>, shift: Vector2<f64>) -> Cost {
        let derivative = Matrix2x3::new(1.0, 0.0, -turned.y, 0.0, 1.0, turned.x);
        let mut cost = Cost::default();
        for index in self.cells.at(turned + shift) {
            let cell = &self.cells.distributions[index];
            let r = turned + shift - cell.mean;
            let br = cell.information * r;
            let distance2 = self.softness * r.dot(&br);
            if distance2 > FAR {
                continue;
            }
            let e = (-0.5 * distance2).exp();
            let scaled = self.softness * e;
            let slopes: Vector3<f64> = derivative.transpose() * br;
            cost.value -= e;
            cost.g += slopes * scaled;
            cost.h += derivative.transpose() * (cell.information * scaled) * derivative
                - slopes * slopes.transpose() * (self.softness * scaled);
            cost.h[(2, 2)] -= scaled * br.dot(&turned);
            cost.observed += derivative.transpose() * (cell.observed * e) * derivative;
        }
        cost
    }

    fn each(&self, pose: &Pose2) -> impl Iterator<Item = Cost> {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let shift = pose.translation();
        let points = self.scan.points.iter().step_by(self.every.max(1));
        points.map(move |point| self.at_point(rotation * point.position, shift))
    }
}

impl Score for Points<'_> {
    fn cost(&self, pose: &Pose2) -> Cost {
        self.each(pose).fold(Cost::default(), |sum, one| Cost {
            value: sum.value + one.value,
            g: sum.g + one.g,
            h: sum.h + one.h,
            observed: sum.observed + one.observed,
        })
    }

    /// The spread of the gradient as the scan's points show it, and what the reference's errors
    /// add: as much where it has as many points, less where it has more.
    fn doubt(&self, pose: &Pose2) -> Doubt {
        let spread: Matrix3<f64> = self.each(pose).map(|one| one.g * one.g.transpose()).sum();
        let mut hits = vec![0.0; self.cells.distributions.len()];
        let mut explained = 0;
        for point in &self.scan.points {
            let place = pose.transform(point.position);
            explained += usize::from(self.cells.explain(place));
            self.cells.at(place).for_each(|cell| hits[cell] += 1.0);
        }
        let counts = self.cells.distributions.iter().map(|cell| cell.count);
        // A cell counts for the scan's points in it, each of which is also off by the error of the
        // cell's line: two numbers from its points.
        let (mut all, mut reference, mut lines) = (f64::MIN_POSITIVE, 0.0, 0.0);
        for (hit, count) in hits.iter().zip(counts) {
            all += hit;
            reference += hit * (hit / count);
            lines += 2.0 * hit / count;
        }
        Doubt { spread: spread * ((all + reference) / (all + lines)), explained }
    }

    fn weight(&self) -> f64 {
        self.scan.len().div_ceil(self.every.max(1)) as f64
    }
}
