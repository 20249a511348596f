use crate::{Drive, FloorPlan, LaserNoise, Robot, Run, Scanner, WheelNoise};
use rand::{Rng, SeedableRng, rngs::StdRng};

impl Default for Robot {
    /// The robot of the demo: 0.6 m/s, three scans a second, 181 beams, ordinary wheels.
    fn default() -> Self {
        Robot {
            drive: Drive::default(),
            scanner: Scanner::half_circle(181, LaserNoise::default()),
            wheels: WheelNoise::default(),
        }
    }
}

/// The demo's building, recorded by the default robot with [`WheelNoise::poor`] wheels: 38 x 24 m,
/// two loops of corridor with a shared middle, rooms with furniture all around; about 137 m of way.
pub fn two_loop_building(seed: u64) -> Run {
    two_loop_building_with(seed, &Robot { wheels: WheelNoise::poor(), ..Robot::default() })
}

/// [`two_loop_building`] with a robot of one's own.
pub fn two_loop_building_with(seed: u64, robot: &Robot) -> Run {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut plan = FloorPlan::new();
    plan.rectangle((0.0, 0.0), (38.0, 24.0));
    two_loop_partitions(&mut plan);
    two_loop_rooms(&mut plan, rng);
    // Cupboards and a fire-hose box along the corridors, against the walls.
    for (x, y, length) in [(11.0, 6.26, 1.2), (26.4, 17.74, 0.9), (16.2, 17.8, 0.6)] {
        plan.block((x + rng.random_range(-0.8..0.8), y), (length, 0.4), 0.0);
    }
    plan.block((31.75, rng.random_range(13.5..15.0)), (0.35, 0.8), 0.0);
    plan.pillar((19.9, 6.1), 0.25).pillar((8.2, 17.9), 0.2);
    Run::record(plan, robot, &TWO_LOOP_WAYPOINTS, seed)
}

/// Corridors run at y 6..8 and 16..18 and at x 6..8, 18..20 and 30..32. The way goes around both
/// loops, visits three rooms, and ends on ground covered before.
const TWO_LOOP_WAYPOINTS: [(f64, f64); 50] = [
    (7.0, 7.0),
    (11.5, 7.0),
    (15.0, 7.1),
    (19.0, 7.0),
    (19.1, 11.0),
    (19.0, 17.0),
    (14.9, 17.0),
    (14.4, 17.5),
    (14.4, 19.0),
    (14.3, 20.5),
    (12.2, 21.0),
    (14.2, 20.4),
    (14.4, 18.9),
    (14.4, 17.3),
    (13.0, 17.0),
    (7.0, 16.9),
    (7.0, 12.4),
    (6.6, 12.0),
    (5.0, 12.0),
    (3.0, 12.1),
    (3.4, 13.0),
    (4.9, 12.1),
    (6.6, 12.0),
    (7.0, 11.5),
    (7.0, 7.2),
    (12.0, 7.1),
    (18.0, 7.0),
    (23.7, 6.9),
    (24.2, 6.4),
    (24.2, 5.0),
    (24.2, 3.2),
    (25.5, 3.0),
    (24.3, 4.4),
    (24.2, 6.5),
    (24.8, 7.0),
    (31.0, 7.0),
    (31.1, 11.6),
    (31.6, 12.1),
    (32.8, 12.1),
    (34.6, 12.3),
    (34.9, 13.6),
    (33.4, 12.2),
    (31.5, 12.1),
    (31.0, 12.6),
    (31.0, 17.0),
    (25.0, 16.9),
    (19.2, 17.0),
    (13.0, 17.0),
    (7.0, 17.0),
    (7.0, 12.5),
];

fn two_loop_partitions(plan: &mut FloorPlan) {
    // Outer rooms' walls towards the corridors, each opening one door.
    plan.partition((0.0, 6.0), (38.0, 6.0), &[(9.5, 0.9), (16.0, 1.0), (23.7, 1.0), (34.0, 0.9)]);
    plan.partition((0.0, 18.0), (38.0, 18.0), &[(2.0, 0.9), (13.9, 1.0), (22.0, 0.9), (29.0, 1.0)]);
    plan.partition((6.0, 6.0), (6.0, 18.0), &[(1.2, 0.9), (5.5, 1.0)]);
    plan.partition((32.0, 6.0), (32.0, 18.0), &[(5.6, 1.0), (10.0, 0.9)]);
    // The two blocks inside the loops, two rooms each.
    for (x0, x1, doors) in [(8.0, 18.0, [2.0, 7.3]), (20.0, 30.0, [3.1, 6.4])] {
        plan.partition((x0, 8.0), (x1, 8.0), &[(doors[0], 0.9)]);
        plan.partition((x0, 16.0), (x1, 16.0), &[(doors[1], 0.9)]);
        plan.partition((x0, 8.0), (x0, 16.0), &[]);
        plan.partition((x1, 8.0), (x1, 16.0), &[(5.0, 1.0)]);
        plan.partition((x0, 0.5 * (doors[0] + doors[1]) + 7.0), (x1, 12.3), &[]);
    }
    // Walls between outer rooms.
    for x in [6.0, 13.5, 20.0, 27.3, 32.0] {
        plan.partition((x, 0.0), (x, 6.0), &[]);
    }
    for x in [6.0, 11.2, 18.5, 26.0, 32.0] {
        plan.partition((x, 18.0), (x, 24.0), &[]);
    }
    plan.partition((0.0, 9.8), (6.0, 9.8), &[]).partition((32.0, 14.6), (38.0, 14.6), &[]);
}

/// Furniture in the rooms: a table with legs, a cupboard, sometimes crates and a bin; nothing where
/// the robot drives.
fn two_loop_rooms(plan: &mut FloorPlan, rng: &mut StdRng) {
    let rooms = [
        (0.0, 0.0, 6.0, 6.0),
        (6.0, 0.0, 13.5, 6.0),
        (13.5, 0.0, 20.0, 6.0),
        (20.0, 0.0, 27.3, 6.0),
        (27.3, 0.0, 32.0, 6.0),
        (32.0, 0.0, 38.0, 6.0),
        (0.0, 6.0, 6.0, 9.8),
        (0.0, 9.8, 6.0, 18.0),
        (32.0, 6.0, 38.0, 14.6),
        (32.0, 14.6, 38.0, 18.0),
        (0.0, 18.0, 6.0, 24.0),
        (6.0, 18.0, 11.2, 24.0),
        (11.2, 18.0, 18.5, 24.0),
        (18.5, 18.0, 26.0, 24.0),
        (26.0, 18.0, 32.0, 24.0),
        (32.0, 18.0, 38.0, 24.0),
        (8.0, 8.0, 18.0, 11.8),
        (8.0, 12.4, 18.0, 16.0),
        (20.0, 8.0, 30.0, 11.8),
        (20.0, 12.4, 30.0, 16.0),
    ];
    for (x0, y0, x1, y1) in rooms {
        furnish(plan, rng, (x0 + 0.4, y0 + 0.4), (x1 - 0.4, y1 - 0.4), &TWO_LOOP_WAYPOINTS);
    }
}

/// Puts random furniture into a rectangle, clear of the polyline that the robot drives.
pub(crate) fn furnish(
    plan: &mut FloorPlan,
    rng: &mut StdRng,
    min: (f64, f64),
    max: (f64, f64),
    way: &[(f64, f64)],
) {
    let mut route = FloorPlan::new();
    route.polyline(way);
    for kind in 0..rng.random_range(3..7) {
        let at = (rng.random_range(min.0..max.0), rng.random_range(min.1..max.1));
        let yaw = if rng.random::<f64>() < 0.7 { 0.0 } else { rng.random_range(-1.5..1.5) };
        let size = (rng.random_range(0.4..1.4), rng.random_range(0.3..0.7));
        let clear = route.clearance(nalgebra::Vector2::new(at.0, at.1));
        if clear < 0.5 + 0.5 * f64::hypot(size.0, size.1) {
            continue;
        }
        match kind % 3 {
            0 => plan.legs(at, size, yaw),
            1 => plan.block(at, size, yaw),
            _ => plan.pillar(at, 0.5 * size.1),
        };
    }
}

/// Two parallel, endless-looking walls, `width` apart and `length` long, around the origin along x:
/// where translation along the axis cannot be observed.
pub fn corridor(length: f64, width: f64) -> FloorPlan {
    let mut plan = FloorPlan::new();
    let (x, y) = (0.5 * length, 0.5 * width);
    plan.wall((-x, -y), (x, -y)).wall((-x, y), (x, y));
    plan
}

/// A round room around the origin: where a turn about its centre cannot be observed. A polygon of
/// 720 sides, 0.1 mm from the circle at 10 m.
pub fn circular_room(radius: f64) -> FloorPlan {
    let mut plan = FloorPlan::new();
    let corner = |k: i32| {
        let (s, c) = (f64::from(k) * std::f64::consts::TAU / 720.0).sin_cos();
        (radius * c, radius * s)
    };
    plan.polyline(&(0..=720).map(corner).collect::<Vec<_>>());
    plan
}

/// A drive from one closed end to the other of a straight corridor, 2 m wide, with a door frame
/// about every `door_spacing` metres.
pub fn corridor_run(seed: u64, length: f64, door_spacing: f64, robot: &Robot) -> Run {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut plan = FloorPlan::new();
    plan.rectangle((0.0, -1.0), (length, 1.0));
    let mut x = door_spacing * rng.random_range(0.5..1.5);
    while x < length - 1.0 {
        let side = if rng.random::<bool>() { 0.94 } else { -0.94 };
        plan.block((x, side), (0.9, 0.12), 0.0);
        x += door_spacing * rng.random_range(0.7..1.3);
    }
    Run::record(plan, robot, &[(1.0, 0.0), (0.5 * length, 0.1), (length - 1.0, 0.0)], seed)
}
