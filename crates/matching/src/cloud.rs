use crate::{LineFitSettings, fit_lines};
use geometry::{Pose2, Vector2};
use sensing::Scan;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

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
    /// Variance of the normal's direction, rad^2.
    pub normal_variance: f64,
    /// Signed distance of the point from the line fitted to its neighbourhood, along the normal,
    /// metres.
    pub line_distance: f64,
    /// Angle between neighbouring beams, radians: the sampling step of the scan.
    pub beam_step: f64,
    /// Index of the beam in its scan.
    pub beam: u32,
}

impl CloudPoint {
    /// A point known without error, `range` metres along the unit vector `ray` from the laser at
    /// the origin, on a surface with this unit normal: what [`fisher_information`] takes.
    ///
    /// [`fisher_information`]: crate::fisher_information
    pub fn exact(ray: Vector2<f64>, range: f64, normal: Vector2<f64>) -> Self {
        CloudPoint {
            position: ray * range,
            ray,
            range,
            normal: Some(normal),
            normal_variance: 0.0,
            line_distance: 0.0,
            beam_step: 0.0,
            beam: 0,
        }
    }
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
    /// Standard deviation of a range, metres: no fit is trusted beyond it.
    pub range_std_m: f64,
    /// How surface lines are fitted. Longer than the production matcher's: WSM chooses its pairs by
    /// these lines, so they must not follow the noise (4 degrees of error at 15 mm and 40 cm).
    pub lines: LineFitSettings,
}

impl Default for PointCloudSettings {
    fn default() -> Self {
        let lines = LineFitSettings::default();
        PointCloudSettings {
            range_std_m: 0.015,
            lines: LineFitSettings { length_m: 0.4, max_neighbours: 20, ..lines },
        }
    }
}

impl PointCloud {
    /// The scan's hits in the robot's base frame, with normals from lines fitted to neighbouring
    /// beams on the same surface.
    pub fn from_scan(scan: &Scan, base_from_laser: &Pose2, settings: &PointCloudSettings) -> Self {
        let beam_step = scan.laser().angle_increment_rad.abs();
        let mut points: Vec<CloudPoint> = (0..scan.len())
            .filter_map(|i| {
                let range = f64::from(scan.hit(i)?);
                let (s, c) = scan.laser().bearing(i).sin_cos();
                let ray = base_from_laser.rotate(Vector2::new(c, s));
                Some(CloudPoint {
                    position: base_from_laser.translation() + ray * range,
                    ray,
                    range,
                    normal: None,
                    normal_variance: 0.0,
                    line_distance: 0.0,
                    beam_step,
                    beam: i as u32,
                })
            })
            .collect();
        fit_surfaces(&mut points, settings);
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

    /// The points by beam, whatever order they came in; for matchers that thin points out or
    /// average them one after another. Scans are such already, submaps become so.
    pub(crate) fn in_order(&self) -> Cow<'_, PointCloud> {
        let by_beam = |a: &CloudPoint, b: &CloudPoint| {
            let position = |p: &CloudPoint| (p.position.x, p.position.y);
            let ((ax, ay), (bx, by)) = (position(a), position(b));
            let place = || ax.total_cmp(&bx).then(ay.total_cmp(&by));
            a.beam.cmp(&b.beam).then(a.range.total_cmp(&b.range)).then_with(place)
        };
        if self.points.is_sorted_by(|a, b| by_beam(a, b).is_le()) {
            return Cow::Borrowed(self);
        }
        let mut points = self.points.clone();
        points.sort_by(by_beam);
        Cow::Owned(PointCloud { points })
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

/// Gives the points of one scan, in beam order, their normals.
fn fit_surfaces(points: &mut [CloudPoint], settings: &PointCloudSettings) {
    let hits: Vec<_> = points.iter().map(|p| (p.position.x, p.position.y, p.range)).collect();
    let starts_new: Vec<bool> =
        (0..points.len()).map(|i| i == 0 || points[i].beam - points[i - 1].beam > 2).collect();
    let lines = LineFitSettings {
        // Noise alone must not make a wall look bent.
        straight_m: settings.lines.straight_m.max(2.0 * settings.range_std_m),
        ..settings.lines
    };
    let fits = fit_lines(&hits, &starts_new, settings.range_std_m, &lines);
    for (point, fit) in points.iter_mut().zip(fits) {
        let Some(fit) = fit else { continue };
        let normal = Vector2::new(fit.normal.0, fit.normal.1);
        let sign = if normal.dot(&point.ray) > 0.0 { -1.0 } else { 1.0 };
        point.normal = Some(normal * sign);
        point.line_distance = fit.distance * sign;
        point.normal_variance = fit.normal_variance;
    }
}
