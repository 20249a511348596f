use geometry::{Matrix2, Pose2, Vector2};
use sensing::Scan;
use serde::{Deserialize, Serialize};

/// One surface point with what is known of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// Position, metres.
    pub position: Vector2<f64>,
    /// Unit vector from the laser to the point.
    pub ray: Vector2<f64>,
    /// Measured range, metres.
    pub range: f64,
    /// Unit surface normal towards the laser; `None` where the neighbourhood is not a smooth line.
    pub normal: Option<Vector2<f64>>,
    /// Angle between neighbouring beams, radians: the sampling step of the scan.
    pub beam_step: f64,
    /// Index of the beam in its scan.
    pub beam: u32,
}

/// Surface points in one frame, of any number and field of view: a scan or a local submap.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// The points, in beam order scan by scan.
    pub points: Vec<CloudPoint>,
}

/// How a scan becomes a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PointCloudSettings {
    /// Neighbours to each side that vote for a point's normal.
    pub normal_neighbours: usize,
    /// A neighbour farther than this share of the range (plus 5 cm) lies on another surface.
    pub jump_ratio: f64,
}

impl Default for PointCloudSettings {
    fn default() -> Self {
        PointCloudSettings { normal_neighbours: 3, jump_ratio: 0.08 }
    }
}

impl PointCloud {
    /// The scan's hits in the robot's base frame, with normals by principal component analysis over
    /// neighbouring beams on the same surface.
    pub fn from_scan(scan: &Scan, base_from_laser: &Pose2, settings: &PointCloudSettings) -> Self {
        let step = scan.laser().angle_increment_rad.abs();
        let mut points: Vec<CloudPoint> = (0..scan.len())
            .filter_map(|i| {
                let range = f64::from(scan.hit(i)?);
                let (s, c) = scan.laser().bearing(i).sin_cos();
                let ray = Vector2::new(c, s);
                let position = base_from_laser.transform(ray * range);
                let ray = base_from_laser.rotate(ray);
                let beam = i as u32;
                Some(CloudPoint { position, ray, range, normal: None, beam_step: step, beam })
            })
            .collect();
        let normals: Vec<_> = (0..points.len()).map(|i| normal_at(&points, i, settings)).collect();
        for (point, normal) in points.iter_mut().zip(normals) {
            point.normal = normal;
        }
        PointCloud { points }
    }

    /// The same points seen from another frame.
    pub fn transformed(&self, target_from_source: &Pose2) -> PointCloud {
        let points = self
            .points
            .iter()
            .map(|p| CloudPoint {
                position: target_from_source.transform(p.position),
                ray: target_from_source.rotate(p.ray),
                normal: p.normal.map(|n| target_from_source.rotate(n)),
                ..*p
            })
            .collect();
        PointCloud { points }
    }

    /// Adds another cloud's points, given in the same frame.
    pub fn extend(&mut self, other: &PointCloud) {
        self.points.extend_from_slice(&other.points);
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True when there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// The normal at `points[i]` from its neighbours in beam order, towards the laser.
fn normal_at(points: &[CloudPoint], i: usize, settings: &PointCloudSettings) -> Option<Vector2<f64>> {
    let centre = &points[i];
    let reach = 0.05 + settings.jump_ratio * centre.range;
    let k = settings.normal_neighbours;
    let (mut n, mut mean, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for p in &points[i.saturating_sub(k)..(i + k + 1).min(points.len())] {
        let d = p.position - centre.position;
        if p.beam.abs_diff(centre.beam) as usize <= k && d.norm() <= reach * k as f64 {
            n += 1.0;
            mean += d;
            second += d * d.transpose();
        }
    }
    if n < 3.0 {
        return None;
    }
    mean /= n;
    let scatter = second / n - mean * mean.transpose();
    let half_diff = 0.5 * (scatter.m11 - scatter.m22);
    let spread = half_diff.hypot(scatter.m12);
    let (large, small) = (0.5 * scatter.trace() + spread, 0.5 * scatter.trace() - spread);
    if small > 0.1 * large {
        return None;
    }
    let tangent_angle = 0.5 * scatter.m12.atan2(half_diff);
    let normal = Vector2::new(-tangent_angle.sin(), tangent_angle.cos());
    Some(if normal.dot(&centre.ray) > 0.0 { -normal } else { normal })
}
