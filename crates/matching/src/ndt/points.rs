use super::cells::Cells;
use super::newton::Cost;
use super::{Doubt, EXPLAINED, Score};
use crate::PointCloud;
use geometry::{Matrix2, Matrix3, Pose2, Vector2, Vector3};

/// Points to distributions (Biber and Strasser 2003): `-sum exp(-r^T B r / 2)` over the scan's
/// points and the reference's cells, `r` from a cell's mean to a point.
pub(super) struct Points<'a> {
    pub cells: Cells,
    pub scan: &'a PointCloud,
}

/// What one point adds: the cost, and the best fit of the cells that it lies in.
fn at_point(cells: &Cells, turned: Vector2<f64>, shift: Vector2<f64>) -> (Cost, f64) {
    let derivatives = [Vector2::x(), Vector2::y(), Vector2::new(-turned.y, turned.x)];
    let mut cost = Cost::default();
    let mut best = 0.0f64;
    for index in cells.at(turned + shift) {
        let cell = &cells.distributions[index];
        let r = turned + shift - cell.mean;
        let br = cell.information * r;
        let e = (-0.5 * r.dot(&br)).exp();
        best = best.max(e);
        cost.value -= e;
        let slopes = Vector3::from(derivatives.map(|d| br.dot(&d)));
        cost.g += slopes * e;
        for (j, dj) in derivatives.iter().enumerate() {
            for (k, dk) in derivatives.iter().enumerate() {
                let curved = if j == 2 && k == 2 { br.dot(&-turned) } else { 0.0 };
                cost.h[(j, k)] +=
                    e * (dj.dot(&(cell.information * dk)) + curved - slopes[j] * slopes[k]);
            }
        }
    }
    (cost, best)
}

impl Points<'_> {
    fn each(&self, pose: &Pose2) -> impl Iterator<Item = (Cost, f64)> {
        let (sin, cos) = pose.yaw.sin_cos();
        let rotation = Matrix2::new(cos, -sin, sin, cos);
        let shift = pose.translation();
        let points = self.scan.points.iter();
        points.map(move |point| at_point(&self.cells, rotation * point.position, shift))
    }
}

impl Score for Points<'_> {
    fn cost(&self, pose: &Pose2) -> Cost {
        self.each(pose).fold(Cost::default(), |sum, (one, _)| Cost {
            value: sum.value + one.value,
            g: sum.g + one.g,
            h: sum.h + one.h,
        })
    }

    /// The spread of the gradient as the scan's points show it, and once more for the reference's.
    fn doubt(&self, pose: &Pose2) -> Doubt {
        let (mut spread, mut explained) = (Matrix3::zeros(), 0);
        for (one, best) in self.each(pose) {
            spread += one.g * one.g.transpose();
            explained += usize::from(best > EXPLAINED);
        }
        Doubt { spread: spread * 2.0, explained }
    }
}
