use crate::LineFitSettings;
use geometry::Pose2;
use sensing::Scan;
use serde::{Deserialize, Serialize};

/// Surface orientations are kept apart in this many layers: normals towards +x, +y, -x, -y.
const LAYERS: usize = 4;
/// "No surfel in reach" in the field.
const NONE: u16 = u16::MAX;
/// A surfel also enters the neighbouring layer when its normal has at least this component along
/// that layer's axis (75 degrees), so that a normal near a layer's border finds it from both sides.
const NEIGHBOUR_LAYER_COMPONENT: f32 = 0.26;

/// Size of a [`SurfelField`]'s cells and how far a surfel is felt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FieldSettings {
    /// Side of a cell, metres: the spacing of surfels on a wall.
    pub cell_m: f32,
    /// A point farther than this from every surfel has no correspondence, metres; at most 15 cells.
    pub reach_m: f32,
    /// Standard deviation of the map's surfaces about their local lines, metres: roughness, clutter
    /// and pose error of the patches, which do not average out.
    pub roughness_m: f32,
}

impl Default for FieldSettings {
    fn default() -> Self {
        FieldSettings { cell_m: 0.1, reach_m: 0.5, roughness_m: 0.01 }
    }
}

/// The tangent line of a small piece of surface, as the matcher reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Surfel {
    /// Unit normal, towards the side it was seen from.
    pub nx: f32,
    pub ny: f32,
    /// The line is `nx x + ny y = offset`.
    pub offset: f32,
    /// Variance of the line's position along its normal, m^2.
    pub variance: f32,
    /// Variance of the normal's direction, rad^2.
    pub normal_variance: f32,
}

/// Sums over the points of one surfel.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    weight: f32,
    x: f32,
    y: f32,
    nx: f32,
    ny: f32,
    normal_weight: f32,
}

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

/// A map of surfels with, for every cell around them, the nearest one: the reference of the fast
/// matcher, kept incrementally.
///
/// Surfels average all points that fell into one cell with like orientation, so a wall seen by many
/// scans is known better than by one. The field lives in one local frame and a fixed window;
/// points outside the window are ignored.
#[derive(Clone, Debug)]
pub struct SurfelField {
    settings: FieldSettings,
    min_x: f32,
    min_y: f32,
    width: usize,
    height: usize,
    /// `[layer][row][column]`: index of the nearest surfel, or `NONE`.
    nearest: Vec<u16>,
    /// `[layer][row][column]`: squared distance to it in cells, 0 only in a surfel's own cell and layer.
    distance: Vec<u8>,
    surfels: Vec<Surfel>,
    moments: Vec<Moments>,
    /// Cell offsets within reach, with squared distance, nearest first.
    stamp: Vec<(i16, i16, u8)>,
}

impl SurfelField {
    /// An empty field over `[min, max]` (metres, in the field's frame).
    pub fn new(settings: FieldSettings, min: (f64, f64), max: (f64, f64)) -> Self {
        let mut field = SurfelField {
            settings,
            min_x: 0.0,
            min_y: 0.0,
            width: 0,
            height: 0,
            nearest: Vec::new(),
            distance: Vec::new(),
            surfels: Vec::new(),
            moments: Vec::new(),
            stamp: disk(settings.reach_m / settings.cell_m),
        };
        field.reset(min, max);
        field
    }

    /// Empties the field and moves its window, reusing memory.
    pub fn reset(&mut self, min: (f64, f64), max: (f64, f64)) {
        let cell = f64::from(self.settings.cell_m);
        self.min_x = min.0 as f32;
        self.min_y = min.1 as f32;
        self.width = ((max.0 - min.0) / cell).ceil().max(1.0) as usize;
        self.height = ((max.1 - min.1) / cell).ceil().max(1.0) as usize;
        let cells = LAYERS * self.width * self.height;
        self.nearest.clear();
        self.nearest.resize(cells, NONE);
        self.distance.clear();
        self.distance.resize(cells, u8::MAX);
        self.surfels.clear();
        self.moments.clear();
    }

    /// Number of surfels.
    pub fn surfel_count(&self) -> usize {
        self.surfels.len()
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &FieldSettings {
        &self.settings
    }

    /// Adds a scan's points, seen from `field_from_scan`.
    pub fn insert(&mut self, points: &[LinePoint], field_from_scan: &Pose2) {
        let moved = LinePoint::mover(field_from_scan);
        for p in points {
            self.insert_point(&moved(p));
        }
    }

    fn insert_point(&mut self, p: &LinePoint) {
        let LinePoint { x, y, nx, ny, variance, .. } = *p;
        let normal_variance = p.normal_variance.max(1e-5);
        let Some((column, row)) = self.cell_of(x, y) else { return };
        let (layer, neighbour_layer) = layers_of(nx, ny);
        let cell = self.index(layer, column, row);
        let weight = 1.0 / variance;
        let (id, is_new) = if self.distance[cell] == 0 {
            (self.nearest[cell], false)
        } else if self.surfels.len() < usize::from(NONE) {
            self.surfels.push(Surfel::default());
            self.moments.push(Moments::default());
            ((self.surfels.len() - 1) as u16, true)
        } else {
            return;
        };
        let m = &mut self.moments[usize::from(id)];
        m.weight += weight;
        m.x += weight * x;
        m.y += weight * y;
        let normal_weight = 1.0 / normal_variance;
        m.normal_weight += normal_weight;
        m.nx += normal_weight * nx;
        m.ny += normal_weight * ny;
        self.surfels[usize::from(id)] = m.line(self.settings.roughness_m);
        if is_new {
            self.spread(id, layer, column, row, 0);
            if let Some(neighbour) = neighbour_layer {
                self.spread(id, neighbour, column, row, 1);
            }
        }
    }

    /// Makes surfel `id` the nearest one in every cell it is nearer to than the present one.
    fn spread(&mut self, id: u16, layer: usize, column: usize, row: usize, at_least: u8) {
        let base = layer * self.width * self.height;
        for &(dx, dy, d) in &self.stamp {
            let (u, v) = (column as isize + isize::from(dx), row as isize + isize::from(dy));
            if u < 0 || v < 0 || u >= self.width as isize || v >= self.height as isize {
                continue;
            }
            let cell = base + v as usize * self.width + u as usize;
            let d = d.max(at_least);
            if d < self.distance[cell] {
                self.distance[cell] = d;
                self.nearest[cell] = id;
            }
        }
    }

    /// True when a surface of the map that faces the viewer lies between `from` and `to` (field frame).
    pub fn blocks(&self, from: (f32, f32), to: (f32, f32)) -> bool {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let length = dx.hypot(dy);
        let steps = (length / self.settings.cell_m) as usize;
        let (ux, uy) = (dx / length.max(1e-6), dy / length.max(1e-6));
        let layer = layer_of(-ux, -uy);
        (1..steps).any(|k| {
            let d = k as f32 * self.settings.cell_m;
            let Some((column, row)) = self.cell_of(from.0 + ux * d, from.1 + uy * d) else {
                return false;
            };
            let cell = self.index(layer, column, row);
            self.distance[cell] == 0
                && self.surfels.get(usize::from(self.nearest[cell])).is_some_and(|s| {
                    s.nx * ux + s.ny * uy < -0.5
                })
        })
    }

    fn cell_of(&self, x: f32, y: f32) -> Option<(usize, usize)> {
        let inverse = 1.0 / self.settings.cell_m;
        let u = (x - self.min_x) * inverse;
        let v = (y - self.min_y) * inverse;
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32;
        inside.then_some((u as usize, v as usize))
    }

    fn index(&self, layer: usize, column: usize, row: usize) -> usize {
        (layer * self.height + row) * self.width + column
    }

    /// The surfel nearest to a point whose surface normal is `(nx, ny)`, if one is in reach.
    pub(crate) fn nearest(&self, x: f32, y: f32, nx: f32, ny: f32) -> Option<&Surfel> {
        let (column, row) = self.cell_of(x, y)?;
        let id = self.nearest[self.index(layer_of(nx, ny), column, row)];
        self.surfels.get(usize::from(id))
    }
}

impl Moments {
    fn line(&self, roughness_m: f32) -> Surfel {
        let inverse = 1.0 / self.weight;
        let norm = 1.0 / self.nx.hypot(self.ny).max(1e-12);
        let (nx, ny) = (self.nx * norm, self.ny * norm);
        Surfel {
            nx,
            ny,
            offset: (nx * self.x + ny * self.y) * inverse,
            variance: inverse + roughness_m * roughness_m,
            normal_variance: 1.0 / self.normal_weight,
        }
    }
}

/// The layer of a normal: the axis direction it is nearest to.
fn layer_of(nx: f32, ny: f32) -> usize {
    if nx.abs() >= ny.abs() { if nx >= 0.0 { 0 } else { 2 } } else if ny >= 0.0 { 1 } else { 3 }
}

/// The layer of a normal and the next one if the normal is not far from it.
fn layers_of(nx: f32, ny: f32) -> (usize, Option<usize>) {
    let layer = layer_of(nx, ny);
    let (along, positive, negative) = if layer % 2 == 0 { (ny, 1, 3) } else { (nx, 0, 2) };
    let neighbour = if along >= 0.0 { positive } else { negative };
    (layer, (along.abs() >= NEIGHBOUR_LAYER_COMPONENT).then_some(neighbour))
}

/// All cell offsets within `radius` cells, nearest first.
fn disk(radius: f32) -> Vec<(i16, i16, u8)> {
    let reach = radius.clamp(1.0, 15.0);
    let r = reach.floor() as i16;
    let mut cells: Vec<(i16, i16, u8)> = (-r..=r)
        .flat_map(|dy| (-r..=r).map(move |dx| (dx, dy, dx * dx + dy * dy)))
        .filter(|&(_, _, d)| f32::from(d) <= reach * reach)
        .map(|(dx, dy, d)| (dx, dy, d as u8))
        .collect();
    cells.sort_by_key(|&(dx, dy, d)| (d, dy, dx));
    cells
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

/// The hits of a scan that lie on a smooth surface, in the robot's base frame, in the form the fast
/// matcher wants.
pub fn line_points(
    scan: &Scan,
    base_from_laser: &Pose2,
    noise: &BeamNoise,
    settings: &LineFitSettings,
) -> Vec<LinePoint> {
    let mut hits = Vec::with_capacity(scan.len());
    let mut rays = Vec::with_capacity(scan.len());
    let mut starts_new = Vec::with_capacity(scan.len());
    let mut last = None;
    for i in 0..scan.len() {
        let Some(range) = scan.hit(i) else { continue };
        let (s, c) = scan.laser().bearing(i).sin_cos();
        let range = f64::from(range);
        hits.push((c * range, s * range, range));
        rays.push((c, s));
        starts_new.push(last.is_none_or(|l: usize| i - l > 2));
        last = Some(i);
    }
    let fits = crate::line_fit::fit_lines(&hits, &starts_new, noise.range_std_m.into(), settings);
    let (s, c) = base_from_laser.yaw.sin_cos();
    let mut out = Vec::with_capacity(hits.len());
    for ((hit, ray), fit) in hits.iter().zip(&rays).zip(&fits) {
        let Some(fit) = fit else { continue };
        let (mut nx, mut ny) = fit.normal;
        let shift = fit.distance * settings.smooth;
        let (px, py) = (hit.0 - shift * nx, hit.1 - shift * ny);
        let cos = nx * ray.0 + ny * ray.1;
        if cos > 0.0 {
            (nx, ny) = (-nx, -ny);
        }
        // Noise of the endpoint along its normal: range noise times the incidence's cosine, bearing
        // noise times its sine.
        let along = f64::from(noise.range_std_m).powi(2) * cos * cos;
        let across = (f64::from(noise.bearing_std_rad) * hit.2).powi(2) * (1.0 - cos * cos).max(0.0);
        out.push(LinePoint {
            x: (base_from_laser.x + c * px - s * py) as f32,
            y: (base_from_laser.y + s * px + c * py) as f32,
            nx: (c * nx - s * ny) as f32,
            ny: (s * nx + c * ny) as f32,
            variance: (along + across + 1e-6) as f32,
            normal_variance: fit.normal_variance as f32,
        });
    }
    out
}
