use crate::line_fit::{LineFit, LineFitSettings, fit_lines};
use geometry::{Pose2, Vector2};
use sensing::{LaserModel, Scan, Sweep};
use serde::{Deserialize, Serialize};

/// One point of a scan as the field and the fast matcher use it: scan frame, `f32`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinePoint {
    /// Position in the scan's base frame, metres.
    pub x: f32,
    /// Position in the scan's base frame, metres.
    pub y: f32,
    /// Unit normal towards the laser.
    pub nx: f32,
    /// Unit normal towards the laser.
    pub ny: f32,
    /// Variance of the point along its normal, m^2 (WSM's measurement error, eq. 4.3-4.5 of the
    /// thesis, projected on the normal).
    pub variance: f32,
    /// Variance of the normal's direction, rad^2.
    pub normal_variance: f32,
}

impl LinePoint {
    /// A function that gives points as seen from another frame.
    pub fn mover(target_from_source: &Pose2) -> impl Fn(&LinePoint) -> LinePoint + use<> {
        let (s, c) = target_from_source.yaw.sin_cos();
        let (s, c) = (s as f32, c as f32);
        let (x, y) = (target_from_source.x as f32, target_from_source.y as f32);
        move |p| LinePoint {
            x: x + c * p.x - s * p.y,
            y: y + s * p.x + c * p.y,
            nx: c * p.nx - s * p.ny,
            ny: s * p.nx + c * p.ny,
            ..*p
        }
    }
}

/// The measurement error model of a laser scanner: WSM's `s_l` and `s_theta`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BeamNoise {
    /// Standard deviation of a range, metres.
    pub range_std_m: f32,
    /// Standard deviation of a bearing, radians.
    pub bearing_std_rad: f32,
}

impl Default for BeamNoise {
    fn default() -> Self {
        BeamNoise { range_std_m: 0.01, bearing_std_rad: 0.002 }
    }
}

/// Turns scans into line points; keeps the bearings of the laser and working memory between scans.
#[derive(Clone, Debug, Default)]
pub struct LineExtractor {
    noise: BeamNoise,
    settings: LineFitSettings,
    laser: Option<LaserModel>,
    /// `(cos, sin)` of every beam's bearing.
    rays: Vec<(f64, f64)>,
    hits: Vec<(f64, f64, f64)>,
    beams: Vec<u32>,
    starts_new: Vec<bool>,
}

/// Where beams meet a wall farther apart than this, its end is too vague to be of use, metres.
const LARGEST_END_M: f64 = 0.25;
/// Variance of a wall's end beside that of where beams meet it, m^2: mixed pixels, rounded edges.
const END_VARIANCE: f64 = 4e-4;
/// By this share of its distance a hit is drawn to the line of its neighbourhood. Of 0, 0.5, 0.7
/// and 1 this gives the smallest error against submaps (1.263, 1.222, 1.228, 1.242 x the bound);
/// all of it would round off what is bent.
const DRAWN_TO_LINE: f64 = 0.5;
/// A gap of more missing beams than this separates surfaces.
const BRIDGED_BEAMS: u32 = 1;

impl LineExtractor {
    /// An extractor for one configuration.
    pub fn new(noise: BeamNoise, settings: LineFitSettings) -> Self {
        LineExtractor { noise, settings, ..LineExtractor::default() }
    }

    /// The hits of a scan that lie on smooth surfaces, in the robot's base frame.
    pub fn extract(&mut self, scan: &Scan, base_from_laser: &Pose2) -> Vec<LinePoint> {
        self.extract_swept(scan, base_from_laser, None)
    }

    /// [`LineExtractor::extract`] of a scan taken while the robot moved: as it would look from
    /// where the robot was at the sweep's reference time.
    pub fn extract_swept(
        &mut self,
        scan: &Scan,
        base_from_laser: &Pose2,
        sweep: Option<&Sweep>,
    ) -> Vec<LinePoint> {
        self.collect_hits(scan);
        if let Some(sweep) = sweep {
            self.move_hits(scan, base_from_laser, sweep);
        }
        let range_std_m = self.noise.range_std_m.into();
        let fits = fit_lines(&self.hits, &self.starts_new, range_std_m, &self.settings);
        let to_base = LinePoint::mover(base_from_laser);
        let hits = self.hits.iter().zip(&self.beams).zip(&fits);
        let surfaces = hits.filter_map(|((hit, &beam), fit)| {
            Some(self.point(hit, self.rays[beam as usize], &(*fit)?))
        });
        let ends = (1..self.hits.len()).filter_map(|i| self.wall_end(i, &fits, scan));
        surfaces.chain(ends).map(|p| to_base(&p)).collect()
    }

    /// Where a wall ends between hits `i - 1` and `i`: there the beam looks past it, at something
    /// farther or at nothing. Its "surface" faces along the wall, which in a corridor is what tells
    /// how far the robot has gone. `None` where there is no such end.
    ///
    /// The wall ends somewhere between the last beam on it and the next one.
    fn wall_end(&self, i: usize, fits: &[Option<LineFit>], scan: &Scan) -> Option<LinePoint> {
        let (before, after) = (&self.hits[i - 1], &self.hits[i]);
        if self.beams[i] - self.beams[i - 1] != 1 {
            return None;
        }
        let near = before.2.min(after.2);
        let (dx, dy) = (after.0 - before.0, after.1 - before.1);
        let jump = self.settings.jump_m + self.settings.jump_ratio * near;
        if dx * dx + dy * dy <= jump * jump {
            return None;
        }
        let (end, side) = if before.2 < after.2 { (i - 1, 1.0) } else { (i, -1.0) };
        let (hit, fit) = (&self.hits[end], fits[end]?);
        let step = scan.laser().angle_increment_rad;
        let ray = self.rays[self.beams[end] as usize];
        let (nx, ny) = fit.normal;
        let facing = (nx * ray.0 + ny * ray.1).abs();
        let spacing = hit.2 * step.abs() / facing.max(1e-3);
        if spacing > LARGEST_END_M {
            return None;
        }
        // Along the wall, towards growing bearings or the other way.
        let outwards = side * step.signum() * (nx * ray.0 + ny * ray.1).signum();
        let (tx, ty) = (-ny * outwards, nx * outwards);
        Some(LinePoint {
            x: (hit.0 + 0.5 * spacing * tx) as f32,
            y: (hit.1 + 0.5 * spacing * ty) as f32,
            nx: tx as f32,
            ny: ty as f32,
            variance: (spacing * spacing / 12.0 + END_VARIANCE) as f32,
            normal_variance: fit.normal_variance as f32,
        })
    }

    /// Moves every hit to where the laser would have seen it at the reference time. The direction
    /// of its beam is left as it is: turned by less than a degree, which is nothing to its noise.
    fn move_hits(&mut self, scan: &Scan, base_from_laser: &Pose2, sweep: &Sweep) {
        let laser_from_base = base_from_laser.inverse();
        for (hit, &beam) in self.hits.iter_mut().zip(&self.beams) {
            let moved = sweep.reference_from_beam(beam as usize, scan.len());
            let laser_from_beam = laser_from_base * moved * *base_from_laser;
            let position = laser_from_beam.transform(Vector2::new(hit.0, hit.1));
            (hit.0, hit.1) = (position.x, position.y);
        }
    }

    fn collect_hits(&mut self, scan: &Scan) {
        if self.laser != Some(*scan.laser()) {
            self.laser = Some(*scan.laser());
            let ray = |i| {
                let (s, c) = scan.laser().bearing(i).sin_cos();
                (c, s)
            };
            self.rays = (0..scan.len()).map(ray).collect();
        }
        self.hits.clear();
        self.beams.clear();
        self.starts_new.clear();
        for (beam, (c, s)) in self.rays.iter().enumerate() {
            let Some(range) = scan.hit(beam) else { continue };
            let range = f64::from(range);
            let beam = beam as u32;
            let gap = self.beams.last().is_none_or(|last| beam - last > 1 + BRIDGED_BEAMS);
            self.hits.push((c * range, s * range, range));
            self.beams.push(beam);
            self.starts_new.push(gap);
        }
    }

    /// A hit with its fit, in the laser's frame.
    fn point(&self, hit: &(f64, f64, f64), ray: (f64, f64), fit: &LineFit) -> LinePoint {
        let (mut nx, mut ny) = fit.normal;
        let cos = nx * ray.0 + ny * ray.1;
        if cos > 0.0 {
            (nx, ny) = (-nx, -ny);
        }
        // Noise of the endpoint along its normal: range noise times the incidence's cosine, bearing
        // noise times its sine (thesis, eq. 4.3).
        let along = f64::from(self.noise.range_std_m).powi(2) * cos * cos;
        let sin2 = (1.0 - cos * cos).max(0.0);
        let across = (f64::from(self.noise.bearing_std_rad) * hit.2).powi(2) * sin2;
        // Its neighbours know where the surface is as well as the hit itself.
        let drawn = DRAWN_TO_LINE * fit.distance;
        LinePoint {
            x: (hit.0 - drawn * fit.normal.0) as f32,
            y: (hit.1 - drawn * fit.normal.1) as f32,
            nx: nx as f32,
            ny: ny as f32,
            variance: (along + across + 1e-6) as f32,
            normal_variance: fit.normal_variance as f32,
        }
    }
}
