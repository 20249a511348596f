use crate::Site;
use crate::buildings::furnish;
use crate::wing::{End, RoomStyle, Rows, Section, Seeds, between, wing};
use geometry::Pose2;
use rand::{Rng, rngs::StdRng};

/// Where ways meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Junction {
    /// Stops before its doors: east, north, west, south. Those of doors that are none are the
    /// stop in the middle.
    pub doors: [usize; 4],
}

/// Stops lie so far beyond a door, metres.
const BEYOND: f64 = 1.0;
/// Width of doors, metres.
const DOOR: f64 = 1.2;
/// Half the width of passages, metres.
const HALF_PASSAGE: f64 = 1.3;
/// Something stands in a passage about every so many metres.
const THINGS_EVERY: f64 = 2.0;

/// Draws a furnished room with doors to the sides that are open: east, north, west, south.
pub(crate) fn junction(
    site: &mut Site,
    rng: &mut StdRng,
    (x, y): (f64, f64),
    open: [bool; 4],
) -> Junction {
    let (half_x, half_y) = (between(rng, (3.5, 5.0)), between(rng, (3.5, 5.0)));
    let (west, east, south, north) = (x - half_x, x + half_x, y - half_y, y + half_y);
    let door =
        |is_open: bool, half: f64| if is_open { vec![(half - 0.5 * DOOR, DOOR)] } else { vec![] };
    site.plan
        .partition((east, south), (east, north), &door(open[0], half_y))
        .partition((west, north), (east, north), &door(open[1], half_x))
        .partition((west, south), (west, north), &door(open[2], half_y))
        .partition((west, south), (east, south), &door(open[3], half_x));
    let (low, high) = ((west + 0.5, south + 0.5), (east - 0.5, north - 0.5));
    let cross = [(west, y), (east, y), (x, y), (x, north), (x, south)];
    for _ in 0..2 {
        furnish(&mut site.plan, rng, low, high, &cross);
    }
    let middle = site.stop((x, y));
    let outside =
        [(east + BEYOND, y), (x, north + BEYOND), (west - BEYOND, y), (x, south - BEYOND)];
    let mut doors = [middle; 4];
    for (k, at) in outside.into_iter().enumerate().filter(|(k, _)| open[*k]) {
        doors[k] = site.stop(at);
        site.chain(&[middle, doors[k]]);
    }
    Junction { doors }
}

/// Draws a passage between two stops, each beyond a door, with things along its walls. It leads
/// east or north.
pub(crate) fn passage(site: &mut Site, rng: &mut StdRng, from: usize, to: usize) {
    let ((x0, y0), (x1, y1)) = (site.stops[from], site.stops[to]);
    let yaw = f64::atan2(y1 - y0, x1 - x0);
    let length = f64::hypot(x1 - x0, y1 - y0);
    let world = Pose2::new(x0, y0, yaw);
    let at = |along: f64, across: f64| {
        let p = world.transform(nalgebra::Vector2::new(along, across));
        (p.x, p.y)
    };
    for side in [-1.0, 1.0] {
        let across = side * HALF_PASSAGE;
        site.plan.wall(at(-BEYOND, across), at(length + BEYOND, across));
        let mut along = between(rng, (0.0, THINGS_EVERY));
        while along < length {
            let size = (between(rng, (0.2, 0.9)), between(rng, (0.1, 0.35)));
            let centre = at(along, side * (HALF_PASSAGE - 0.5 * size.1));
            match rng.random_range(0..3) {
                0 => site.plan.pillar(centre, 0.5 * size.1),
                _ => site.plan.block(centre, size, yaw),
            };
            along += THINGS_EVERY * between(rng, (0.5, 2.5));
        }
    }
    site.chain(&[from, to]);
}

/// Draws a corridor with rooms, small or large, from `origin` eastwards; the stops outside its two
/// doors.
pub(crate) fn offices(
    site: &mut Site,
    rng: &mut StdRng,
    (x, y): (f64, f64),
    length: f64,
    large: bool,
) -> (usize, usize) {
    let share = between(rng, (0.3, 0.7));
    let sections = [share * length, (1.0 - share) * length].map(|length| {
        let width = between(rng, if large { (6.0, 8.0) } else { (3.2, 4.5) });
        let depth = between(rng, if large { (5.0, 6.5) } else { (3.5, 5.0) });
        let rooms =
            RoomStyle { width: (width, width + 2.0), depth: (depth, depth + 1.0), shut: 0.3 };
        let rows = if rng.random::<f64>() < 0.8 { Rows::Both } else { Rows::North };
        let seeds = Seeds { walls: rng.random(), doors: rng.random(), furniture: rng.random() };
        Section { length, rows, rooms, seeds }
    });
    let drawn = wing(between(rng, (2.2, 2.6)), &sections, [End::Door, End::Door]);
    let first = site.append(drawn.site.placed(&Pose2::new(x, y, 0.0)));
    let corridor = drawn.corridor;
    (first + corridor[0], first + corridor[corridor.len() - 1])
}

/// Draws a hall with pillars and stands from `origin` eastwards; the stops outside its two doors.
pub(crate) fn hall(
    site: &mut Site,
    rng: &mut StdRng,
    (x, y): (f64, f64),
    length: f64,
) -> (usize, usize) {
    let half = between(rng, (5.5, 8.0));
    let door = [(half - 0.5 * DOOR, DOOR)];
    site.plan
        .partition((x, y - half), (x, y + half), &door)
        .partition((x + length, y - half), (x + length, y + half), &door)
        .partition((x, y - half), (x + length, y - half), &[])
        .partition((x, y + half), (x + length, y + half), &[]);
    let columns = (length / 7.0) as usize;
    let pitch = length / columns as f64;
    let lanes = [-0.6 * half, 0.0, 0.6 * half];
    let stop = |column: usize, lane: f64| (x + (column as f64 + 0.5) * pitch, y + lane);
    let mut ways = vec![(x, y), (x + length, y)];
    for lane in lanes {
        ways.extend([stop(0, lane), stop(columns - 1, lane)]);
    }
    for column in 0..columns {
        let (low, high) = ((x + column as f64 * pitch, y - half), (pitch, 2.0 * half));
        let high = (low.0 + high.0, low.1 + high.1);
        ways.extend([stop(column, lanes[0]), stop(column, lanes[2])]);
        for _ in 0..3 {
            furnish(&mut site.plan, rng, low, high, &ways);
        }
    }
    let ends = (site.stop((x - BEYOND, y)), site.stop((x + length + BEYOND, y)));
    let grid = lanes.map(|lane| (0..columns).map(|c| site.stop(stop(c, lane))).collect::<Vec<_>>());
    for lane in &grid {
        site.chain(lane);
    }
    let [south, middle, north] = &grid;
    for ((a, b), c) in south.iter().zip(middle).zip(north) {
        site.chain(&[*a, *b, *c]);
    }
    site.chain(&[ends.0, grid[1][0]]);
    site.chain(&[grid[1][columns - 1], ends.1]);
    ends
}
