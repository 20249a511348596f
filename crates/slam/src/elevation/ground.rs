use super::{ElevationSettings, biases, slope_of};
use crate::map::Map;
use geometry::{Pose2, Vector2};
use manifold::{Islands, Manifold, Patch, PatchId};
use matching::LinePoint;
use rayon::prelude::*;
use sensing::Scan;
use std::collections::BTreeMap;
use std::sync::Arc;

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

/// Where robots stood, to tell ground from walls.
pub struct KnownGround<'a> {
    manifold: &'a Manifold,
    islands: Islands,
    laser_height_m: f64,
    stands: Vec<Option<Stand>>,
    cells: BTreeMap<(i64, i64), Vec<usize>>,
}

impl<'a> KnownGround<'a> {
    /// What is known of a map whose heights were estimated; nothing where no robot told its
    /// attitude.
    pub fn new(manifold: &'a Manifold, settings: &ElevationSettings) -> Self {
        let stands = stands(manifold);
        let mut cells: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
        for (index, stand) in stands.iter().enumerate() {
            if let Some(stand) = stand {
                cells.entry(cell_of(&stand.pose.translation())).or_default().push(index);
            }
        }
        let islands = manifold.component_map();
        let laser_height_m = settings.laser_height_m;
        KnownGround { manifold, islands, laser_height_m, stands, cells }
    }

    /// The scan of a patch with the beams that met ground left out: they say nothing of walls.
    pub fn walls_of(&self, patch: PatchId) -> Arc<Scan> {
        let Patch { scan, base_from_laser, .. } = self.manifold.patch(patch);
        self.walls_in(scan, patch, base_from_laser)
    }

    /// [`KnownGround::walls_of`] for another scan that was taken at a patch, with its laser seen
    /// from there; one of a leaning robot put on the plan.
    pub fn walls_in(
        &self,
        scan: &Arc<Scan>,
        patch: PatchId,
        patch_from_laser: &Pose2,
    ) -> Arc<Scan> {
        let is_ground = |beam: usize| {
            scan.hit(beam).is_some_and(|range| {
                let (sin, cos) = scan.laser().bearing(beam).sin_cos();
                let hit = Vector2::new(cos, sin) * f64::from(range);
                self.is_ground(patch, patch_from_laser.transform(hit))
            })
        };
        if !(0..scan.len()).any(is_ground) {
            return scan.clone();
        }
        Arc::new(scan.without(is_ground))
    }

    /// True where a beam ended on ground: a point on the plan, patch frame. From the foot of a ramp
    /// a level laser sees the ramp as a wall that recedes as the robot begins to climb; where
    /// robots stood and the ground is as high as the beam, there is no wall.
    fn is_ground(&self, patch: PatchId, seen: Vector2<f64>) -> bool {
        let Some(own) = &self.stands[patch.index()] else { return false };
        let hit_m = own.height_m + self.laser_height_m + own.slope.dot(&seen);
        let place = own.pose.transform(seen);
        let (u, v) = cell_of(&place);
        let island = self.islands.of[patch.index()];
        let near = (-1..=1)
            .flat_map(|dv| (-1..=1).map(move |du| (u + du, v + dv)))
            .filter_map(|cell| self.cells.get(&cell))
            .flatten();
        near.filter(|other| self.islands.of[**other] == island)
            .filter_map(|other| self.stands[*other].as_ref())
            .any(|other| {
                (other.height_m - own.height_m).abs() > DIFFERENT_M
                    && (other.pose.translation() - place).norm() < KNOWN_M
                    && (other.ground_at(place) - hit_m).abs() < NEAR_M
            })
    }
}

/// Leaves what beams hit of the ground out of the surfaces: now that a ramp has been driven, it is
/// known better. What was left out before and is no ground as the map is now is taken in again.
pub(crate) fn forget_ground(map: &mut Map, settings: &ElevationSettings) {
    for (patch, whole) in std::mem::take(&mut map.with_ground) {
        map.surfaces[patch.index()] = whole;
    }
    if map.manifold.patches().iter().all(|patch| patch.elevation.is_none()) {
        return;
    }
    let ground = KnownGround::new(&map.manifold, settings);
    let forget = |(index, surface): (usize, &mut Vec<LinePoint>)| {
        let patch = PatchId(index as u32);
        let seen = |p: &LinePoint| Vector2::new(f64::from(p.x), f64::from(p.y));
        ground.stands.get(index)?.as_ref()?;
        let walls: Vec<LinePoint> =
            surface.iter().filter(|p| !ground.is_ground(patch, seen(p))).copied().collect();
        let is_less = walls.len() < surface.len();
        is_less.then(|| (patch, std::mem::replace(surface, walls)))
    };
    map.with_ground = map.surfaces.par_iter_mut().enumerate().filter_map(forget).collect();
}

fn stands(manifold: &Manifold) -> Vec<Option<Stand>> {
    let biases = biases(manifold);
    let stand = |patch: &Patch| {
        let height_m = patch.elevation?.height_m;
        let slope = slope_of(patch, &biases).unwrap_or_else(Vector2::zeros);
        Some(Stand { pose: patch.island_from_patch, height_m, slope })
    };
    manifold.patches().iter().map(stand).collect()
}

fn cell_of(place: &Vector2<f64>) -> (i64, i64) {
    ((place.x / KNOWN_M).floor() as i64, (place.y / KNOWN_M).floor() as i64)
}
