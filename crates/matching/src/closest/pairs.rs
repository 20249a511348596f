use super::{ClosestSettings, Correspondence, Partner};
use crate::{CloudPoint, PointCloud};
use geometry::{Matrix2, Pose2, Vector2};

/// A scan point and the reference point closest to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosestPair {
    pub reference: CloudPoint,
    pub scan: CloudPoint,
    /// Index of the reference point.
    pub reference_index: usize,
    /// Index of the scan point.
    pub scan_index: usize,
    /// See [`Partner::along`].
    pub along: Option<Vector2<f64>>,
    /// From the scan point, moved, to the reference point, in the reference frame.
    pub residual: Vector2<f64>,
    /// Information of the residual.
    pub weight: Matrix2<f64>,
    /// The weighted square of the residual, by which bad pairs are told.
    pub error: f64,
}

impl ClosestPair {
    /// Whether both points can lie on the same surface, as far as their normals are known.
    pub fn normals_agree(&self, rotation: &Matrix2<f64>, normal_cos: f64) -> bool {
        match (self.reference.normal, self.scan.normal) {
            (Some(a), Some(b)) => a.dot(&(rotation * b)) >= normal_cos,
            _ => true,
        }
    }

    /// What is left of the weight when the partner slides along its segment with the scan point.
    pub fn sliding_weight(&self) -> Matrix2<f64> {
        slid(&self.weight, self.along)
    }

    /// Takes a weight; false if it is none, or says nothing finite.
    pub fn weigh(&mut self, weight: Option<Matrix2<f64>>) -> bool {
        let Some(weight) = weight else { return false };
        self.weight = weight;
        self.error = self.residual.dot(&(weight * self.residual));
        self.error.is_finite() && weight.iter().all(|v| v.is_finite())
    }
}

/// What is left of a weight when the partner slides.
pub(super) fn slid(weight: &Matrix2<f64>, along: Option<Vector2<f64>>) -> Matrix2<f64> {
    let Some(along) = along else { return *weight };
    let pull = weight * along;
    let stiffness = along.dot(&pull);
    if stiffness > 0.0 { weight - pull * pull.transpose() / stiffness } else { *weight }
}

/// Pairs within the gate, in the order of the scan's points; not weighed yet.
pub(crate) fn closest_pairs(
    correspondence: &impl Correspondence,
    scan: &PointCloud,
    pose: &Pose2,
    gate_m: f64,
) -> Vec<ClosestPair> {
    let (sin, cos) = pose.yaw.sin_cos();
    let (rotation, translation) = (Matrix2::new(cos, -sin, sin, cos), pose.translation());
    let pair = |(scan_index, &scan): (usize, &CloudPoint)| {
        let moved = rotation * scan.position + translation;
        let Partner { index, point, along } = correspondence.closest(&moved, gate_m)?;
        let residual = point.position - moved;
        let weight = Matrix2::zeros();
        Some(ClosestPair {
            reference: point,
            scan,
            reference_index: index,
            scan_index,
            along,
            residual,
            weight,
            error: 0.0,
        })
    };
    scan.points.iter().enumerate().filter_map(pair).collect()
}

/// Keeps this share of pairs, those with the smallest errors, and of those the ones not far beyond
/// the quantile (Censi, "An ICP variant using a point-to-line metric", ICRA 2008, section III).
/// Equal errors stay or go together, so that the order of points does not matter.
pub(crate) fn drop_worst(pairs: &mut Vec<ClosestPair>, settings: &ClosestSettings, keep: f64) {
    if pairs.is_empty() {
        return;
    }
    let mut errors: Vec<f64> = pairs.iter().map(|pair| pair.error).collect();
    errors.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let last = errors.len() - 1;
        errors[((share.clamp(0.0, 1.0) * errors.len() as f64) as usize).min(last)]
    };
    // Errors are squares, and so is the factor on their roots.
    let adaptive = settings.adaptive_factor.powi(2) * quantile(settings.adaptive_quantile);
    let most = quantile(keep).min(if adaptive.is_nan() { f64::INFINITY } else { adaptive });
    pairs.retain(|pair| pair.error <= most);
}
