use crate::{FloorPlan, RayCaster, Scanner};
use geometry::{Pose2, Vector2};
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::Scan;

/// A random room of about 10 x 8 m around the origin, with an alcove, a chamfered corner, a doorway
/// into a corridor and three pillars; free within 1 m of the origin.
pub fn noisy_room(seed: u64) -> FloorPlan {
    let rng = &mut StdRng::seed_from_u64(seed);
    let (left, right) = (-rng.random_range(4.0..6.0), rng.random_range(4.0..6.0));
    let (low, high) = (-rng.random_range(3.0..5.0), rng.random_range(3.0..5.0));
    let chamfer = rng.random_range(0.5..1.5);
    let (alcove, depth) = (rng.random_range(left + 1.0..0.0), rng.random_range(0.4..1.2));
    let alcove_end = alcove + rng.random_range(1.0..2.5);
    let door = rng.random_range(low + 0.5..high - 1.8);
    let mut plan = FloorPlan::new();
    plan.polyline(&[
        (right, door),
        (right, low),
        (left + chamfer, low),
        (left, low + chamfer),
        (left, high),
        (alcove, high),
        (alcove, high + depth),
        (alcove_end, high + depth),
        (alcove_end, high),
        (right, high),
        (right, door + 1.0),
        (right + 0.15, door + 1.0),
        (right + 0.15, high),
    ]);
    plan.polyline(&[(right, door), (right + 0.15, door), (right + 0.15, low)]);
    plan.wall((right + 2.2, low - 2.0), (right + 2.2, high + 2.0));
    while plan.circles.len() < 3 {
        let centre = (rng.random_range(left + 0.6..right - 0.6), rng.random_range(low..high));
        let radius = rng.random_range(0.1..0.3);
        if Vector2::new(centre.0, centre.1).norm() > 1.0 + radius {
            plan.pillar(centre, radius);
        }
    }
    plan
}

/// Two scans of one place with the truth between them.
#[derive(Clone, Debug)]
pub struct RoomPair {
    /// The place.
    pub world: RayCaster,
    /// The earlier scan.
    pub reference: Scan,
    /// The later scan.
    pub scan: Scan,
    /// True base pose of the earlier scan, world frame.
    pub world_from_reference: Pose2,
    /// True base pose of the later scan, world frame.
    pub world_from_scan: Pose2,
}

impl RoomPair {
    /// True pose of the later scan seen from the earlier one.
    pub fn truth(&self) -> Pose2 {
        self.world_from_reference.between(&self.world_from_scan)
    }
}

/// Two scans in [`noisy_room`], `distance` metres and `yaw` radians (left or right) apart, in a
/// random direction: the matcher tests' unit of work.
pub fn noisy_room_pair(seed: u64, scanner: &Scanner, distance: f64, yaw: f64) -> RoomPair {
    let rng = &mut StdRng::seed_from_u64(seed.wrapping_mul(0x9E37_79B9).wrapping_add(1));
    let mut angle = || rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
    let (heading, direction) = (angle(), angle());
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let at = |x: f64| Pose2::new(x * direction.cos(), x * direction.sin(), 0.0);
    let turn = |yaw: f64| Pose2::new(0.0, 0.0, yaw);
    let world_from_reference = at(-0.5 * distance) * turn(heading);
    let world_from_scan = at(0.5 * distance) * turn(heading + sign * yaw);
    let world = RayCaster::new(noisy_room(seed));
    let reference = scanner.scan(&world, &world_from_reference, rng);
    let scan = scanner.scan(&world, &world_from_scan, rng);
    RoomPair { world, reference, scan, world_from_reference, world_from_scan }
}
