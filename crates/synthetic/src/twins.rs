use crate::site::Route;
use crate::twin_worlds::{Building, TwinWorld, twin_world};
use crate::wing::between;
use crate::{LaserNoise, RayCaster, Robot, Run, Scanner, WheelNoise};
use geometry::Pose2;
use rand::{Rng, SeedableRng, rngs::StdRng};

/// What looks alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TwinFamily {
    /// A room that is found in two buildings, once or several times in each.
    Rooms,
    /// A corridor with its rooms that is found in two buildings, as on two storeys of one.
    Corridors,
    /// A building and its mirror image, or one that half a turn brings nearly onto itself and
    /// another built alike.
    Mirrored,
}

impl TwinFamily {
    /// Every family.
    pub const ALL: [TwinFamily; 3] =
        [TwinFamily::Rooms, TwinFamily::Corridors, TwinFamily::Mirrored];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            TwinFamily::Rooms => "rooms",
            TwinFamily::Corridors => "corridors",
            TwinFamily::Mirrored => "mirrored",
        }
    }
}

/// How robots' grounds are related in a case of [`twins`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// The second robot drives where things only look like what the first has seen: two islands.
    Apart,
    /// All robots drive over the same ground: one island.
    Together,
}

/// What of one building is copied in the other, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwinPart {
    /// Furniture and doors are copied too; else walls alone, and the rest is drawn anew. (A small
    /// room may have no place for furniture: then it is a copy all the same.)
    pub exact: bool,
    /// The second is the mirror image of the first, in its own frame: `y` turned round.
    pub mirrored: bool,
    /// Each building's frame: its corridor runs along x through the origin.
    pub world_from_building: [Pose2; 2],
    /// From where to where along x each building has the copied part, metres.
    pub along: [(f64, f64); 2],
}

/// Robots in look-alike places, and how many islands the truth has.
#[derive(Clone, Debug, PartialEq)]
pub struct TwinCase {
    /// What looks alike.
    pub family: TwinFamily,
    /// Same ground or not.
    pub meeting: Meeting,
    /// What is copied.
    pub part: TwinPart,
    /// One run for each robot, in one world frame.
    pub runs: Vec<Run>,
    /// Which building each robot drives in: the true island of each.
    pub buildings: Vec<usize>,
    /// How many islands there truly are.
    pub true_islands: usize,
    /// Beams of every robot's laser.
    pub beams: u32,
    /// Range of every robot's laser, metres.
    pub max_range_m: f64,
    /// How far each robot drives after the part that looks alike, metres; at most some metres less
    /// or more.
    pub beyond_m: Vec<f64>,
}

/// A case of look-alike places: two robots, in one seed of four three. Both kinds of meeting have
/// the same world and robots for the same seed. A robot drives the part that looks alike first,
/// and then anywhere in its building; in [`TwinFamily::Rooms`] one in four never leaves the room.
pub fn twins(family: TwinFamily, seed: u64, meeting: Meeting) -> TwinCase {
    let rng = &mut StdRng::seed_from_u64(seed ^ ((family as u64 + 1) << 40));
    let world = twin_world(family, rng);
    let robot = random_robot(rng);
    let robots = if rng.random::<f64>() < 0.25 { 3 } else { 2 };
    let caster = RayCaster::new(world.site.plan.clone());
    let buildings: Vec<usize> =
        (0..robots).map(|number| usize::from(number == 1 && meeting == Meeting::Apart)).collect();
    let mut case = TwinCase {
        family,
        meeting,
        part: world.part,
        runs: Vec::new(),
        true_islands: if meeting == Meeting::Apart { 2 } else { 1 },
        buildings,
        beams: robot.scanner.laser.beams,
        max_range_m: robot.scanner.noise.max_range,
        beyond_m: Vec::new(),
    };
    for (number, &building) in case.buildings.iter().enumerate() {
        let beyond_m = random_distance(family, rng);
        let route = route(&world, &world.buildings[building], family, beyond_m, rng);
        let way = world.site.waypoints(rng, &route);
        let run = Run::record_in(&caster, &robot, &way, rng.random());
        case.runs.push(run.of_robot(number as u16));
        case.beyond_m.push(beyond_m);
    }
    case
}

/// Lasers of 181 or 361 beams and 15 to 40 m, good to bad wheels.
fn random_robot(rng: &mut StdRng) -> Robot {
    let beams = if rng.random::<bool>() { 181 } else { 361 };
    let noise = LaserNoise { max_range: between(rng, (15.0, 40.0)), ..LaserNoise::default() };
    let scale = between(rng, (0.3, 1.0));
    let poor = WheelNoise::poor();
    let wheels = WheelNoise {
        yaw_per_metre: poor.yaw_per_metre * scale,
        yaw_drift: poor.yaw_drift * between(rng, (-1.0, 1.0)),
        yaw_scale: poor.yaw_scale * between(rng, (-1.0, 1.0)),
        ..poor
    };
    Robot { scanner: Scanner::half_circle(beams, noise), wheels, ..Robot::default() }
}

/// How far a robot drives after the part that looks alike, metres: as often short as long.
fn random_distance(family: TwinFamily, rng: &mut StdRng) -> f64 {
    let nowhere = rng.random::<f64>() < 0.25;
    let exponent = rng.random::<f64>();
    match family {
        TwinFamily::Rooms if nowhere => 0.0,
        TwinFamily::Rooms => 5.0 * 16.0_f64.powf(exponent),
        _ => 15.0 * 8.0_f64.powf(exponent),
    }
}

/// Through the part that looks alike, then anywhere in the building.
fn route(
    world: &TwinWorld,
    building: &Building,
    family: TwinFamily,
    beyond_m: f64,
    rng: &mut StdRng,
) -> Route {
    let site = &world.site;
    let mut first = if family == TwinFamily::Rooms {
        let room = &building.room;
        let start = room[rng.random_range(0..room.len())];
        let metres = site.length(room) * between(rng, (1.2, 2.0));
        site.wander(rng, start, metres, |stop| room.contains(&stop))
    } else {
        let (from, to) = building.corridor;
        let there = rng.random::<bool>();
        if there { site.shortest(from, to) } else { site.shortest(to, from) }
    };
    let last = first[first.len() - 1];
    let on = site.wander(rng, last, beyond_m, |stop| building.stops.contains(&stop));
    first.extend_from_slice(&on[1..]);
    first
}
