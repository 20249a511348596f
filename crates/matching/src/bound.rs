use crate::PointCloud;
use geometry::{Matrix3, Vector3};

/// Fisher information of one scan about its pose in a known map, as right perturbation in the
/// scan's frame (Censi, "On achievable accuracy for range-finder localization", ICRA 2007, eq. 8;
/// the form used here is that of point-to-line residuals weighted by `1 / (s^2 cos^2 incidence)`).
///
/// `truth` holds the true positions, rays, ranges and normals of the scan's beams; points without a
/// normal and beams that graze their surface (cosine below 0.05) tell nothing that this first-order
/// bound covers. Independent noise of range, metres, and bearing, radians.
pub fn fisher_information(
    truth: &PointCloud,
    range_std_m: f64,
    bearing_std_rad: f64,
) -> Matrix3<f64> {
    let mut information = Matrix3::zeros();
    for point in &truth.points {
        let Some(normal) = point.normal else { continue };
        let cos = -normal.dot(&point.ray);
        if cos < 0.05 {
            continue;
        }
        let tan = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        let variance = range_std_m.powi(2) + (point.range * bearing_std_rad * tan).powi(2);
        let p = point.position;
        let g = Vector3::new(normal.x, normal.y, normal.y * p.x - normal.x * p.y) / cos;
        information += g * g.transpose() / variance;
    }
    information
}

/// Lower bound of the covariance of a scan's pose against a reference that `scans` equally good
/// scans were averaged into: `(1 + 1/m) I^-1`; 2 I^-1 for two scans. `None` where a direction is
/// open.
///
/// `information` is to count the beams only that hit what the reference has seen.
pub fn cramer_rao_bound(information: &Matrix3<f64>, scans: usize) -> Option<Matrix3<f64>> {
    let covariance = information.try_inverse()?;
    Some(covariance * (1.0 + 1.0 / scans.max(1) as f64))
}
