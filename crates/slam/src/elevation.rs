//! Heights of patches, from what the inertial units tell of the ways between them.

mod ground;
mod measured;
mod solve;

use crate::map::Map;
use crate::unit_bias::Mode;
use geometry::Vector2;
pub use ground::KnownGround;
pub(crate) use ground::forget_ground;
use manifold::{Climb, Elevation, Manifold, Patch, PatchId};
use measured::Rise;
use rayon::prelude::*;
use sensing::Attitude;
use serde::{Deserialize, Serialize};
use solve::heights_on;

/// Heights by inertial unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ElevationSettings {
    /// Height of the lasers above the ground, metres: where the beams of a leaning robot meet the
    /// floor. Logs do not tell it; scanners on small robots sit this high.
    pub laser_height_m: f64,
    /// Error of a pitch reading beside its bias, radians: rough floor, acceleration, noise.
    pub pitch_noise_rad: f64,
    /// Errors of the pitch change over this distance, metres.
    pub correlation_m: f64,
}

impl Default for ElevationSettings {
    fn default() -> Self {
        ElevationSettings { laser_height_m: 0.3, pitch_noise_rad: 0.01, correlation_m: 1.0 }
    }
}

/// A way that rises less than this is level, radians: 1.5 degrees. Floors are built level to within
/// a degree, ramps steeper than two.
const LEVEL_RAD: f64 = 0.0262;
/// How far from level a floor is, radians, and over which distance that changes, metres.
const FLOOR_RAD: f64 = 0.0035;
const FLOOR_CORRELATION_M: f64 = 5.0;
/// Share of a rise that slipping wheels and the pitching at a ramp's ends put in doubt.
const RISE_SHARE: f64 = 0.05;
/// How well the bias of a unit is known from its most frequent reading, radians.
const BIAS_STD_RAD: f64 = 0.005;
/// Ways shorter than this tell no slope, metres.
const LEAST_WAY_M: f64 = 0.1;
/// Variance of a height that nothing tells any more, m^2: higher than any building.
const UNKNOWN_M2: f64 = 1e6;

/// The rise of a climb and its variance, given the unit's bias in pitch: what is nearly level is a
/// floor.
pub(crate) fn climbed(climb: &Climb, bias_rad: f64) -> (f64, f64) {
    let rise_m = climb.rise_m + bias_rad * climb.distance_m;
    if is_level(rise_m, climb.distance_m) {
        let way_m = climb.distance_m.abs() + LEAST_WAY_M;
        return (0.0, FLOOR_RAD * FLOOR_RAD * way_m * FLOOR_CORRELATION_M);
    }
    (rise_m, climb.variance_m2 + (RISE_SHARE * rise_m).powi(2))
}

/// The height so far from a known one, without a word of what lies between.
pub(crate) fn unknown_rise(from: Elevation, distance_m: f64) -> Elevation {
    let doubt_m = measured::UNKNOWN_SLOPE * distance_m;
    Elevation { variance_m2: from.variance_m2 + doubt_m * doubt_m, ..from }
}

fn is_level(rise_m: f64, distance_m: f64) -> bool {
    rise_m.abs() <= LEVEL_RAD * distance_m.abs().max(LEAST_WAY_M)
}

/// Rise per metre forwards and to the left of the ground that a robot stands on: zero on a floor.
pub(crate) fn slope(reading: &Attitude, bias: &Attitude) -> Vector2<f64> {
    let slope = raw_slope(reading, bias);
    if slope.norm() <= LEVEL_RAD { Vector2::zeros() } else { slope }
}

/// [`slope`] as it is read.
pub(crate) fn raw_slope(reading: &Attitude, bias: &Attitude) -> Vector2<f64> {
    let attitude = reading.without(bias);
    let steepest = |angle: f64| angle.clamp(-1.0, 1.0).tan();
    let forwards = -steepest(attitude.pitch_rad);
    let sideways = steepest(attitude.roll_rad) / attitude.pitch_rad.clamp(-1.0, 1.0).cos();
    Vector2::new(forwards, sideways)
}

/// Estimates the heights of all patches of islands in which some robot has an inertial unit, with
/// the bias of every unit; elsewhere nothing changes.
pub(crate) fn estimate_elevations(map: &mut Map) {
    let manifold = &map.manifold;
    if manifold.patches().iter().all(|patch| patch.attitude.is_none()) {
        return;
    }
    let biases = biases(manifold);
    let islands = manifold.component_map();
    let mut rises: Vec<Vec<Rise>> = vec![Vec::new(); islands.members.len()];
    for rise in measured::rises(manifold, &islands, &biases) {
        rises[islands.of(rise.from)].push(rise);
    }
    let on = |(island, rises): (&Vec<PatchId>, Vec<Rise>)| {
        let told = island.iter().any(|&patch| manifold.patch(patch).attitude.is_some());
        told.then(|| heights_on(island, &rises))
    };
    let found = islands.members.par_iter().zip(rises).filter_map(on).flatten_iter();
    let found: Vec<(PatchId, Elevation)> = found.collect();
    let mut heights = vec![None; manifold.patches().len()];
    found.into_iter().for_each(|(patch, height)| heights[patch.index()] = Some(height));
    map.slopes = slopes(manifold, &biases);
    let changed = changed(manifold, &heights);
    map.manifold.elevate(changed);
}

/// What a map that was kept does not hold: the slopes under its patches, and which surfaces are
/// ground.
pub(crate) fn recall_ground(map: &mut Map, settings: &ElevationSettings) {
    map.slopes = slopes(&map.manifold, &biases(&map.manifold));
    forget_ground(map, settings);
}

fn slopes(manifold: &Manifold, biases: &[Attitude]) -> Vec<Vector2<f64>> {
    let slope = |patch: &Patch| slope_of(patch, biases).unwrap_or_else(Vector2::zeros);
    manifold.patches().iter().map(slope).collect()
}

/// Rise per metre forwards and to the left of the ground under a patch; zero on a floor, `None`
/// where nothing tells.
fn slope_of(patch: &Patch, biases: &[Attitude]) -> Option<Vector2<f64>> {
    let bias = biases[usize::from(patch.robot.0)];
    patch.attitude.map(|attitude| slope(&attitude, &bias))
}

/// What each robot's unit reads on the level: the most frequent pitch of its ways, and the most
/// frequent roll of its patches.
fn biases(manifold: &Manifold) -> Vec<Attitude> {
    let robots = manifold.patches().iter().map(|p| usize::from(p.robot.0) + 1).max().unwrap_or(0);
    let (mut modes, mut rolls) = (vec![Mode::new(); robots], vec![Mode::new(); robots]);
    for patch in manifold.patches() {
        if let Some(reading) = patch.attitude {
            rolls[usize::from(patch.robot.0)].observe(reading.roll_rad, 1.0);
        }
    }
    for way in manifold.ways() {
        let Some(climb) = way.climb else { continue };
        if climb.distance_m.abs() > LEAST_WAY_M {
            let pitch = (-climb.rise_m / climb.distance_m).clamp(-1.0, 1.0).asin();
            let robot = usize::from(manifold.patch(way.from).robot.0);
            modes[robot].observe(pitch, climb.distance_m.abs());
        }
    }
    let bias = |(pitch, roll): (&Mode, &Mode)| Attitude {
        roll_rad: roll.estimate(),
        pitch_rad: pitch.estimate(),
    };
    modes.iter().zip(&rolls).map(bias).collect()
}

fn changed(manifold: &Manifold, heights: &[Option<Elevation>]) -> Vec<(PatchId, Elevation)> {
    let unknown = Elevation { height_m: 0.0, variance_m2: UNKNOWN_M2 };
    let patches = manifold.patches().iter().zip(heights);
    patches
        .map(|(patch, height)| (patch, height.or(patch.elevation.map(|_| unknown))))
        .filter(|(patch, height)| patch.elevation != *height)
        .filter_map(|(patch, height)| Some((patch.id, height?)))
        .collect()
}
