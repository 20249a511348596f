use super::WsmSettings;
use crate::{CloudPoint, PointCloud};
use geometry::{Matrix2, Vector2};
use std::f64::consts::FRAC_PI_8;

/// What of the offset's variance counts each way where the surface is not known: half of it, since
/// the offset has one direction only; and half of that, since the nearest of two samplings is off
/// by one of their steps and not by both. Counting all of it trusts the ill-fitted lines beside
/// such points more than the points, which pulls on curved surfaces.
const UNKNOWN_DIRECTION: f64 = 0.25;

/// A cloud point with the error model of the Weighted Scan Matcher, in the cloud's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WeightedPoint {
    /// The measured position.
    pub position: Vector2<f64>,
    /// Where the ray meets the local line: what pairs are chosen by, see docs/math/wsm.md.
    pub smoothed: Vector2<f64>,
    /// Covariance of measurement noise and bias, m^2.
    pub noise: Matrix2<f64>,
    /// Variance of a neighbour's offset along the surface, m^2: the correspondence error.
    pub spacing_variance: f64,
    /// Distance to the neighbours along the surface, m.
    pub spacing: f64,
    /// The surface, where it is a line.
    pub surface: Option<SurfaceLine>,
}

/// Direction of the local surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SurfaceLine {
    /// Unit normal, towards the laser.
    pub normal: Vector2<f64>,
    /// Variance of its direction, rad^2.
    pub variance: f64,
}

/// The error model of every point of a cloud that can be used.
pub(crate) fn weighted_points(cloud: &PointCloud, settings: &WsmSettings) -> Vec<WeightedPoint> {
    cloud.points.iter().filter(|p| is_usable(p)).map(|p| weighted_point(p, settings)).collect()
}

/// Where the point's ray meets its surface line.
///
/// Along the ray, not along the normal: the noise is along the ray, so this is where the beam
/// really hit, while a foot of the perpendicular still carries the noise along the surface. Grazing
/// rays are not moved farther than by a tenth of their range.
fn drawn_onto_line(point: &CloudPoint, normal: Vector2<f64>) -> Vector2<f64> {
    let cos = normal.dot(&point.ray);
    let shift = if cos.abs() > 1e-3 { point.line_distance / cos } else { 0.0 };
    let limit = 0.1 * point.range;
    point.position - point.ray * shift.clamp(-limit, limit)
}

fn is_usable(p: &CloudPoint) -> bool {
    let normal = p.normal.unwrap_or_default();
    let vectors = [p.position, p.ray, normal, Vector2::new(p.normal_variance, p.line_distance)];
    let sane = |v: f64| v.is_finite() && v.abs() < 1e6;
    vectors.iter().all(|v| sane(v.x) && sane(v.y))
        && sane(p.beam_step)
        && sane(p.range)
        && p.range > 0.0
}

fn weighted_point(point: &CloudPoint, settings: &WsmSettings) -> WeightedPoint {
    let surface = point.normal.and_then(|normal| {
        let (normal, variance) = (normal.try_normalize(1e-9)?, point.normal_variance.max(0.0));
        Some(SurfaceLine { normal, variance })
    });
    let position = point.position;
    let smoothed = surface.map_or(position, |line| drawn_onto_line(point, line.normal));
    let (u, v) = (point.ray, Vector2::new(-point.ray.y, point.ray.x));
    let along = settings.range_std_m.powi(2) + settings.range_bias_m.powi(2);
    let across = (point.range * settings.bearing_std_rad).powi(2);
    let noise = u * u.transpose() * along + v * v.transpose() * across;
    let (spacing, spacing_variance) = sampling(point, surface.as_ref(), settings);
    WeightedPoint { position, smoothed, noise, spacing_variance, spacing, surface }
}

/// Distance to the neighbouring samples along the surface, and the variance of the correspondence
/// error: uniform between the neighbours before and behind,
/// `(d_min^3 + d_max^3) / (3 (d_min + d_max))`, with
/// `d = l sin(beta) / sin(alpha +- beta)`.
///
/// `alpha` is the angle between beam and surface, at least three beam steps (the formula has a pole
/// at one); `beta` the beam step, halved where pairs are nearest neighbours, which are at most half
/// a spacing away.
fn sampling(
    point: &CloudPoint,
    surface: Option<&SurfaceLine>,
    settings: &WsmSettings,
) -> (f64, f64) {
    let step = point.beam_step.abs().clamp(1e-5, 0.2);
    let alpha = match surface {
        Some(line) => line.normal.dot(&point.ray).abs().min(1.0).asin().max(3.0 * step),
        None => FRAC_PI_8.max(3.0 * step),
    };
    let beta = if settings.half_spacing { 0.5 * step } else { step };
    let near = point.range * beta.sin() / (alpha + beta).sin();
    let far = point.range * beta.sin() / (alpha - beta).sin();
    let variance = (near.powi(3) + far.powi(3)) / (3.0 * (near + far));
    let variance = if surface.is_none() && settings.half_spacing {
        UNKNOWN_DIRECTION * variance
    } else {
        variance
    };
    (point.range * step / alpha.sin(), variance)
}
