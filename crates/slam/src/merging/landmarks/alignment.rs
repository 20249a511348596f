use super::island::{IslandLandmarks, turned};
use geometry::{GaussianPose2, LieGroup, Matrix2, Matrix3, Pose2, Vector2, Vector3, wrap_angle};
use nalgebra::Matrix2x3;

/// A landmark of the target taken for one of the source: their indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Pairing {
    pub target: usize,
    pub source: usize,
}

/// Two islands whose landmarks are to be brought to cover each other.
#[derive(Clone, Copy)]
pub(crate) struct Islands<'a> {
    pub target: &'a IslandLandmarks,
    pub source: &'a IslandLandmarks,
}

/// What two places of the same landmark may differ by beside their covariances, m^2: two maps of
/// one wall differ by about 2 cm (the grid error of `bench/runs`).
const FLOOR_M2: f64 = 4e-4;
/// Steps of Gauss and Newton; they converge in four or five from the closed form.
const STEPS: usize = 10;

impl Islands<'_> {
    pub fn positions(&self, p: Pairing) -> (Vector2<f64>, Vector2<f64>) {
        let target = self.target.landmarks[p.target].in_island();
        (target, self.source.landmarks[p.source].in_island())
    }

    /// Covariance of `T s - t` for a pairing when the source's axes are turned by `yaw`, the drift
    /// counted from the landmarks of the pairing `from`.
    pub fn spread(&self, p: Pairing, from: Pairing, yaw: f64) -> Matrix2<f64> {
        let target = self.target.landmarks[p.target].covariance_in_island();
        let source = self.source.landmarks[p.source].covariance_in_island();
        let source = source + self.source.drift(p.source, from.source);
        target
            + self.target.drift(p.target, from.target)
            + turned(&source, yaw)
            + Matrix2::identity() * FLOOR_M2
    }

    /// The distances of two landmarks on the target and on the source, and the standard deviation
    /// of their difference.
    pub fn distances(&self, a: Pairing, b: Pairing) -> (f64, f64, f64) {
        let ((ta, sa), (tb, sb)) = (self.positions(a), self.positions(b));
        let along = |island: &IslandLandmarks, i: usize, j: usize, step: Vector2<f64>| {
            let of = |k: usize| island.landmarks[k].covariance_in_island();
            let spread = of(i) + of(j) + island.drift(i, j) + Matrix2::identity() * FLOOR_M2;
            let unit = step.try_normalize(1e-9).unwrap_or_else(Vector2::x);
            unit.dot(&(spread * unit))
        };
        let variance = along(self.target, a.target, b.target, tb - ta)
            + along(self.source, a.source, b.source, sb - sa);
        ((tb - ta).norm(), (sb - sa).norm(), variance.sqrt())
    }

    /// How the source lies to the target so that the pairings' landmarks cover each other best: the
    /// closed form with a weight for each (Umeyama 1991, in the plane and without scale), then
    /// weighted by their full covariances. `None` where they do not tell.
    pub fn align(&self, pairings: &[Pairing]) -> Option<GaussianPose2> {
        let from = self.middle(pairings)?;
        let mut pose = self.closed_form(pairings, from)?;
        let mut hessian = Matrix3::zeros();
        for _ in 0..STEPS {
            let mut gradient = Vector3::zeros();
            hessian = Matrix3::zeros();
            for &p in pairings {
                self.add(p, from, &pose, &mut hessian, &mut gradient);
            }
            let step = -(hessian.cholesky()?.solve(&gradient));
            pose = pose.retract(&step);
            if step.norm() < 1e-9 {
                break;
            }
        }
        let covariance = hessian.try_inverse()?;
        pose.is_finite().then_some(GaussianPose2 { mean: pose, covariance })
    }

    /// Adds a pairing's terms of the normal equations, by right perturbations of `pose`.
    fn add(
        &self,
        p: Pairing,
        from: Pairing,
        pose: &Pose2,
        hessian: &mut Matrix3<f64>,
        gradient: &mut Vector3<f64>,
    ) {
        let (t, s) = self.positions(p);
        let jacobian = point_jacobian(pose, &s);
        if let Some(weight) = self.spread(p, from, pose.yaw).try_inverse() {
            *hessian += jacobian.transpose() * weight * jacobian;
            *gradient += jacobian.transpose() * weight * (pose.transform(s) - t);
        }
        if let Some((error, variance)) = self.turn_error(p, pose) {
            hessian[(2, 2)] += 1.0 / variance;
            gradient[2] += error / variance;
        }
    }

    /// How much a pairing's headings differ, radians, and the variance; `None` without headings.
    pub fn turn_error(&self, p: Pairing, pose: &Pose2) -> Option<(f64, f64)> {
        let (target, a) = self.target.landmarks[p.target].yaw_in_island()?;
        let (source, b) = self.source.landmarks[p.source].yaw_in_island()?;
        Some((wrap_angle(pose.yaw + source - target), (a + b).max(1e-6)))
    }

    /// The pairing from which the others are known best: drift is counted from it.
    pub fn middle(&self, pairings: &[Pairing]) -> Option<Pairing> {
        let cost = |from: &Pairing| -> f64 {
            let to = |p: &Pairing| {
                let target = self.target.drift(p.target, from.target).trace();
                target + self.source.drift(p.source, from.source).trace()
            };
            pairings.iter().map(to).sum()
        };
        pairings.iter().map(|p| (cost(p), *p)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|m| m.1)
    }

    fn closed_form(&self, pairings: &[Pairing], from: Pairing) -> Option<Pose2> {
        let weighted = |p: &Pairing| {
            let (t, s) = self.positions(*p);
            (1.0 / self.spread(*p, from, 0.0).trace(), t, s)
        };
        let points: Vec<_> = pairings.iter().map(weighted).collect();
        let sum: f64 = points.iter().map(|p| p.0).sum();
        let target = points.iter().map(|p| p.1 * p.0).sum::<Vector2<f64>>() / sum;
        let source = points.iter().map(|p| p.2 * p.0).sum::<Vector2<f64>>() / sum;
        let (mut cos, mut sin) = (0.0, 0.0);
        for (w, t, s) in points {
            let (t, s) = (t - target, s - source);
            cos += w * s.dot(&t);
            sin += w * s.perp(&t);
        }
        // Headings vote as pairs of landmarks a metre apart would.
        for p in pairings {
            if let Some((error, variance)) = self.turn_error(*p, &Pose2::IDENTITY) {
                cos += error.cos() / variance;
                sin -= error.sin() / variance;
            }
        }
        let turn = Pose2::new(0.0, 0.0, sin.atan2(cos));
        let shift = target - turn.transform(source);
        (cos.hypot(sin) > 0.0).then(|| Pose2::new(shift.x, shift.y, turn.yaw))
    }
}

/// Derivative of `T p` by the right perturbation of `T`: `R [I | J p]`, `J` a quarter turn.
pub(crate) fn point_jacobian(pose: &Pose2, point: &Vector2<f64>) -> Matrix2x3<f64> {
    let (s, c) = pose.yaw.sin_cos();
    let rotation = Matrix2::new(c, -s, s, c);
    let quarter = rotation * Vector2::new(-point.y, point.x);
    Matrix2x3::new(c, -s, quarter.x, s, c, quarter.y)
}
