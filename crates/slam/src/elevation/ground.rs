use super::ElevationSettings;
use crate::map::Map;
use geometry::{Pose2, Vector2};
use matching::LinePoint;
use std::collections::BTreeMap;

/// The ground around a robot is known this far from where it stood, metres: half a ramp's width.
const KNOWN_M: f64 = 1.5;
/// A hit this near to the ground is the ground, metres; lasers are mounted higher.
const NEAR_M: f64 = 0.2;
/// Ground at the height of the robot that looks is below its laser, however far; only ground that
/// differs in height by more than this is met by its beams, metres.
const DIFFERENT_M: f64 = 0.1;

/// What was known of the ground where a patch was taken.
struct Stand {
    pose: Pose2,
    height_m: f64,
    /// Rise per metre forwards and to the left.
    slope: Vector2<f64>,
}

impl Stand {
    /// Height of the plane through the ground at a point of the island.
    fn ground_at(&self, point: Vector2<f64>) -> f64 {
        self.height_m + self.slope.dot(&self.pose.inverse().transform(point))
    }
}

/// Forgets what beams hit of the ground: where robots stood and the ground is as high as the beam,
/// there is no wall. From the foot of a ramp a level laser sees the ramp as a wall that recedes as
/// the robot begins to climb; now that the ramp has been driven, it is known better.
pub(crate) fn forget_ground(map: &mut Map, settings: &ElevationSettings) {
    let stands = stands(map);
    let mut cells: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
    for (index, stand) in stands.iter().enumerate() {
        if let Some(stand) = stand {
            cells.entry(cell_of(&stand.pose.translation())).or_default().push(index);
        }
    }
    let islands = map.manifold.component_map();
    for (index, stand) in stands.iter().enumerate() {
        let Some(own) = stand else { continue };
        let is_ground = |p: &LinePoint| {
            let seen = Vector2::new(f64::from(p.x), f64::from(p.y));
            let hit_m = own.height_m + settings.laser_height_m + own.slope.dot(&seen);
            let place = own.pose.transform(seen);
            let (u, v) = cell_of(&place);
            let near = (-1..=1)
                .flat_map(|dv| (-1..=1).map(move |du| (u + du, v + dv)))
                .filter_map(|cell| cells.get(&cell))
                .flatten();
            near.filter(|other| islands.of[**other] == islands.of[index])
                .filter_map(|other| stands[*other].as_ref())
                .any(|other| {
                    (other.height_m - own.height_m).abs() > DIFFERENT_M
                        && (other.pose.translation() - place).norm() < KNOWN_M
                        && (other.ground_at(place) - hit_m).abs() < NEAR_M
                })
        };
        map.surfaces[index].retain(|p| !is_ground(p));
    }
}

fn stands(map: &Map) -> Vec<Option<Stand>> {
    let stand = |(patch, slope): (&manifold::Patch, &Vector2<f64>)| {
        let height_m = patch.elevation?.height_m;
        Some(Stand { pose: patch.island_from_patch, height_m, slope: *slope })
    };
    map.manifold.patches().iter().zip(&map.slopes).map(stand).collect()
}

fn cell_of(place: &Vector2<f64>) -> (i64, i64) {
    ((place.x / KNOWN_M).floor() as i64, (place.y / KNOWN_M).floor() as i64)
}
