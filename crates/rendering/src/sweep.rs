use crate::{CastSettings, GridFrame, ScanView};
use geometry::Vector2;

/// What one scan says of the plane, in cell units: the area it looked through, and the surfaces
/// it saw.
///
/// Beams of a scanner are cones, not lines: a beam vouches for the wedge half way to its
/// neighbours. The wedges together are a star-shaped polygon around the laser, which has no gaps
/// between far beams and counts a cell once however many beams cross it.
pub(crate) struct Sweep {
    /// The free area: a closed polygon, counter-clockwise.
    pub free: Vec<Vector2<f64>>,
    /// Surface points, chain after chain.
    pub surface: Vec<Vector2<f64>>,
    /// Index after the last point of each chain in `surface`.
    pub chain_ends: Vec<usize>,
    /// Rows touched: smallest and largest y.
    pub rows: (f64, f64),
}

/// Widest half wedge that a beam may vouch for, radians (1 degree; SICK beams are 0.5 to 1 apart).
const MAX_HALF_WEDGE_RAD: f64 = 0.0175;
/// Neighbouring hits this much farther apart than a surface seen head-on would put them still
/// belong together, metres: twice the range noise of common scanners.
const SURFACE_SLACK_M: f64 = 0.03;
/// Longest piece of wall interpolated between two hits, metres; doors are wider.
const MAX_CHORD_M: f64 = 0.7;
/// Most oblique wall interpolated: the chord over the arc between the beams (84 degrees incidence).
const MAX_OBLIQUENESS: f64 = 10.0;
/// Longest run of beams without return that counts as dropouts.
const MAX_DROPOUT_BEAMS: usize = 5;

struct Beam {
    ray: Vector2<f64>,
    /// End of the hit, metres from the laser; `None` without a hit.
    end: Option<Vector2<f64>>,
    /// Free distance along the beam, metres.
    clear: f64,
}

impl Sweep {
    pub fn new(view: &ScanView, frame: &GridFrame, settings: &CastSettings) -> Self {
        let beams = beams_counter_clockwise(view, settings);
        let step = view.scan.laser().angle_increment_rad.abs();
        let joined: Vec<bool> = (1..beams.len()).map(|i| same_surface(&beams, i, step)).collect();
        let origin = frame.cells_from_map(view.map_from_laser.translation());
        let scale = 1.0 / frame.resolution_m;
        let place = |p: Vector2<f64>| origin + p * scale;

        let mut sweep =
            Sweep { free: vec![origin], surface: vec![], chain_ends: vec![], rows: (0.0, 0.0) };
        sweep.trace_free(&beams, &joined, step, 0.5 * frame.resolution_m, place);
        sweep.trace_surface(&beams, &joined, place);
        let ys = sweep.free.iter().chain(&sweep.surface).map(|p| p.y);
        sweep.rows = ys.fold((origin.y, origin.y), |(lo, hi), y| (lo.min(y), hi.max(y)));
        sweep
    }

    /// The polygon of free space, pulled back from surfaces by `margin` metres at right angles, so
    /// that a scan does not see through the cells it hits.
    fn trace_free(
        &mut self,
        beams: &[Beam],
        joined: &[bool],
        step: f64,
        margin: f64,
        place: impl Fn(Vector2<f64>) -> Vector2<f64>,
    ) {
        let (s, c) = (0.5 * step).min(MAX_HALF_WEDGE_RAD).sin_cos();
        let left = |v: Vector2<f64>| Vector2::new(c * v.x - s * v.y, s * v.x + c * v.y);
        let right = |v: Vector2<f64>| Vector2::new(c * v.x + s * v.y, c * v.y - s * v.x);
        let narrow = 0.5 * step > MAX_HALF_WEDGE_RAD;
        for (i, beam) in beams.iter().enumerate() {
            let before = i > 0 && joined[i - 1];
            let after = i + 1 < beams.len() && joined[i];
            let neighbour = match (before, after) {
                (true, true) => beams[i + 1].end.zip(beams[i - 1].end).map(|(a, b)| a - b),
                (true, false) => beam.end.zip(beams[i - 1].end).map(|(a, b)| a - b),
                (false, true) => beams[i + 1].end.zip(beam.end).map(|(a, b)| a - b),
                (false, false) => None,
            };
            let sine = neighbour.map_or(1.0, |along| along.normalize().perp(&beam.ray).abs());
            let pull = if beam.end.is_some() { margin / sine.max(0.2) } else { 0.0 };
            let reach = (beam.clear - pull).max(0.0) * beam.ray;
            if !before {
                self.free.push(place(right(reach)));
            }
            self.free.push(place(reach));
            if !after {
                self.free.push(place(left(reach)));
                if narrow {
                    self.free.push(self.free[0]);
                }
            }
        }
    }

    fn trace_surface(
        &mut self,
        beams: &[Beam],
        joined: &[bool],
        place: impl Fn(Vector2<f64>) -> Vector2<f64>,
    ) {
        for (i, beam) in beams.iter().enumerate() {
            let Some(end) = beam.end else { continue };
            self.surface.push(place(end));
            if i + 1 >= beams.len() || !joined[i] {
                self.chain_ends.push(self.surface.len());
            }
        }
    }
}

/// The scan's beams with increasing bearing, whichever way the scanner turns.
fn beams_counter_clockwise(view: &ScanView, settings: &CastSettings) -> Vec<Beam> {
    let laser = view.scan.laser();
    let beam = |i: usize| {
        let (s, c) = (view.map_from_laser.yaw + laser.bearing(i)).sin_cos();
        let ray = Vector2::new(c, s);
        let range = f64::from(view.scan.range(i));
        let (end, clear) = match view.scan.class(i) {
            sensing::BeamClass::Hit if range <= settings.max_range_m => (Some(ray * range), range),
            sensing::BeamClass::Hit => (None, settings.max_range_m),
            sensing::BeamClass::NoReturn => (None, settings.no_return_clear_m.min(range)),
            sensing::BeamClass::TooClose | sensing::BeamClass::Invalid => (None, 0.0),
        };
        Beam { ray, end, clear }
    };
    let mut beams: Vec<Beam> = if laser.angle_increment_rad < 0.0 {
        (0..view.scan.len()).rev().map(beam).collect()
    } else {
        (0..view.scan.len()).map(beam).collect()
    };
    restrain_dropouts(&mut beams);
    beams
}

/// A few beams without return between hits are more likely a dark or glossy spot than a gap: they
/// clear no farther than the nearer of the hits beside them.
fn restrain_dropouts(beams: &mut [Beam]) {
    let mut last_hit: Option<usize> = None;
    for i in 0..beams.len() {
        if beams[i].end.is_none() {
            continue;
        }
        if let Some(last) = last_hit.filter(|last| i - last <= MAX_DROPOUT_BEAMS + 1) {
            let limit = beams[i].clear.min(beams[last].clear);
            beams[last + 1..i].iter_mut().for_each(|b| b.clear = b.clear.min(limit));
        }
        last_hit = Some(i);
    }
}

/// Do beams `i - 1` and `i` end on one surface, so that the wall between them may be interpolated?
///
/// Yes when they are about as near as on a wall seen head-on; farther apart (oblique walls), only
/// when the hit before or the hit after lies on the same straight line.
fn same_surface(beams: &[Beam], i: usize, step: f64) -> bool {
    let (Some(a), Some(b)) = (beams[i - 1].end, beams[i].end) else { return false };
    let arc = step * beams[i - 1].clear.min(beams[i].clear);
    let chord = b - a;
    let gap = chord.norm();
    if gap > MAX_CHORD_M {
        return false;
    }
    if gap <= 1.3 * arc + SURFACE_SLACK_M {
        return true;
    }
    let direction = chord / gap;
    let on_line = |p: Option<Vector2<f64>>| {
        p.is_some_and(|p| {
            let d = p - a;
            d.perp(&direction).abs() <= SURFACE_SLACK_M
                && d.norm() <= 2.0 * MAX_CHORD_M
                && (d.norm() > gap || (p - b).norm() > gap)
        })
    };
    let before = i.checked_sub(2).and_then(|k| beams[k].end);
    let after = beams.get(i + 1).and_then(|beam| beam.end);
    gap <= MAX_OBLIQUENESS * arc && (on_line(before) || on_line(after))
}
