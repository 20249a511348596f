use geometry::{Pose2, Vector2};
use sensing::{BeamClass, Scan};
use std::ops::AddAssign;

/// A scan from where its laser was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'a> {
    pub scan: &'a Scan,
    pub map_from_laser: Pose2,
}

/// What two scans say of each other: points of one that the other also sees, and points that lie
/// where the other looked through. Points behind what the other sees count for nothing: a new room
/// contradicts nobody.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Visibility {
    pub agreeing: u32,
    pub contradicting: u32,
}

/// A point within this of a surface is on it, metres and share of its range: matches are good to
/// centimetres, beams to half a degree, walls are seen at an angle.
const NEAR_M: f64 = 0.2;
const NEAR_SHARE: f64 = 0.03;
/// Between beams farther apart than this a scan knows nothing, radians.
const WIDEST_RAD: f64 = 0.04;

impl Visibility {
    /// Compares two scans, each with what the other sees.
    pub fn of(one: &View, other: &View) -> Self {
        let mut visibility = seen_from(one, other);
        visibility += seen_from(other, one);
        visibility
    }

    /// Points that say anything.
    pub fn compared(&self) -> u32 {
        self.agreeing + self.contradicting
    }

    /// Share of contradicting points; 0 where there is nothing to compare.
    pub fn contradiction(&self) -> f64 {
        f64::from(self.contradicting) / f64::from(self.compared().max(1))
    }
}

impl AddAssign for Visibility {
    fn add_assign(&mut self, other: Visibility) {
        self.agreeing += other.agreeing;
        self.contradicting += other.contradicting;
    }
}

/// The hits of `seen` as they look from `viewer`.
pub(crate) fn seen_from(viewer: &View, seen: &View) -> Visibility {
    let viewer_from_seen = viewer.map_from_laser.between(&seen.map_from_laser);
    let laser = seen.scan.laser();
    let mut visibility = Visibility::default();
    for beam in 0..seen.scan.len() {
        let Some(range) = seen.scan.hit(beam) else { continue };
        let (sin, cos) = laser.bearing(beam).sin_cos();
        let point = viewer_from_seen.transform(Vector2::new(cos, sin) * f64::from(range));
        match classify(viewer.scan, point) {
            Some(true) => visibility.agreeing += 1,
            Some(false) => visibility.contradicting += 1,
            None => {}
        }
    }
    visibility
}

/// True for a point, in the laser's frame, on a surface that a scan sees; false for one where it
/// looked through; `None` for one it knows nothing of.
fn classify(scan: &Scan, point: Vector2<f64>) -> Option<bool> {
    let laser = scan.laser();
    if laser.angle_increment_rad.abs() > WIDEST_RAD {
        return None;
    }
    let from_first = geometry::wrap_angle(point.y.atan2(point.x) - laser.angle_min_rad);
    let turned = if from_first * laser.angle_increment_rad < 0.0 {
        from_first + laser.angle_increment_rad.signum() * std::f64::consts::TAU
    } else {
        from_first
    };
    let nearest = (turned / laser.angle_increment_rad).round();
    let last = scan.len().checked_sub(1)?;
    if nearest > last as f64 {
        return None;
    }
    let nearest = nearest as usize;
    let range = point.norm();
    let near = NEAR_M + NEAR_SHARE * range;
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for beam in nearest.saturating_sub(1)..=(nearest + 1).min(last) {
        if scan.class(beam) != BeamClass::Hit {
            return None;
        }
        least = least.min(f64::from(scan.range(beam)));
        most = most.max(f64::from(scan.range(beam)));
    }
    if range + near < least { Some(false) } else { (range < most + near).then_some(true) }
}
