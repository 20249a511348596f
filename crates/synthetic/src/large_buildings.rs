use crate::buildings::furnish;
use crate::{FloorPlan, Robot, Run};
use rand::{Rng, SeedableRng, rngs::StdRng};

/// An office floor of `size` x `size` blocks of look-alike rooms between parallel corridors, driven
/// row by row: the place-recognition trap. One block is 12 x 10 m; a run of size 3 is some 200 m
/// long.
pub fn office(seed: u64, size: usize, robot: &Robot) -> Run {
    let size = size.clamp(1, 20);
    Run::record(office_plan(seed, size), robot, &office_way(size), seed)
}

/// The floor plan of [`office`]: 14 m to a block along x and 12 m along y, and 2 m of corridor
/// around.
pub fn office_plan(seed: u64, size: usize) -> FloorPlan {
    let rng = &mut StdRng::seed_from_u64(seed);
    let size = size.clamp(1, 20);
    let (width, height) = (14.0 * size as f64 + 2.0, 12.0 * size as f64 + 2.0);
    let mut plan = FloorPlan::new();
    plan.rectangle((0.0, 0.0), (width, height));
    let way = office_way(size);
    for row in 0..size {
        for column in 0..size {
            let (x, y) = (14.0 * column as f64 + 2.0, 12.0 * row as f64 + 2.0);
            office_block(&mut plan, rng, x, y);
            for (dx, dy) in [(0.5, 0.5), (6.5, 0.5), (0.5, 5.5), (6.5, 5.5)] {
                // Half of the rooms are empty, so that they really look alike.
                if rng.random::<bool>() {
                    furnish(&mut plan, rng, (x + dx, y + dy), (x + dx + 5.0, y + dy + 4.0), &way);
                }
            }
        }
    }
    plan
}

/// Four equal rooms of 6 x 5 m, each with one door at nearly the same place.
fn office_block(plan: &mut FloorPlan, rng: &mut StdRng, x: f64, y: f64) {
    let mut door = || (rng.random_range(2.3..2.7), 0.9);
    let (south, north) = ([door(), door()], [door(), door()]);
    for (wall_y, doors) in [(y, south), (y + 10.0, north)] {
        plan.partition((x, wall_y), (x + 6.0, wall_y), &doors[..1]);
        plan.partition((x + 6.0, wall_y), (x + 12.0, wall_y), &doors[1..]);
    }
    plan.partition((x, y), (x, y + 10.0), &[]).partition((x + 12.0, y), (x + 12.0, y + 10.0), &[]);
    plan.partition((x + 6.0, y), (x + 6.0, y + 10.0), &[]);
    plan.partition((x, y + 5.0), (x + 12.0, y + 5.0), &[]);
}

/// Along every horizontal corridor in turn, and back to the start down the first vertical one.
fn office_way(size: usize) -> Vec<(f64, f64)> {
    let right = 14.0 * size as f64 + 1.0;
    let mut way = Vec::new();
    for row in 0..=size {
        let y = 12.0 * row as f64 + 1.0;
        let ends = if row % 2 == 0 { [1.0, right] } else { [right, 1.0] };
        way.extend(ends.map(|x| (x, y)));
    }
    let top = 12.0 * size as f64 + 1.0;
    way.extend([(1.0, top), (1.0, 1.0), (8.0, 1.0), (15.0, 1.0)]);
    way
}

/// A square ring of corridor, `length` metres around and 2.4 m wide, bare but for a door frame
/// about every `door_spacing` metres, driven once around and `overlap` metres on.
pub fn ring_corridor(
    seed: u64,
    length: f64,
    door_spacing: f64,
    overlap: f64,
    robot: &Robot,
) -> Run {
    let rng = &mut StdRng::seed_from_u64(seed);
    let side = 0.25 * length;
    let mut plan = FloorPlan::new();
    plan.rectangle((-1.2, -1.2), (side + 1.2, side + 1.2));
    plan.rectangle((1.2, 1.2), (side - 1.2, side - 1.2));
    let mut way = door_spacing * rng.random_range(0.5..1.0);
    while way < length {
        let (edge, along) = ((way / side) as usize, way % side);
        let across = if rng.random::<bool>() { 1.14 } else { -1.14 };
        let clear = (2.0..side - 2.0).contains(&along);
        let (centre, size) = match edge {
            0 => ((along, across), (0.9, 0.12)),
            1 => ((side + across, along), (0.12, 0.9)),
            2 => ((side - along, side + across), (0.9, 0.12)),
            _ => ((across, side - along), (0.12, 0.9)),
        };
        if clear {
            plan.block(centre, size, 0.0);
        }
        way += door_spacing * rng.random_range(0.7..1.3);
    }
    let corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0)];
    let mut points = vec![(1.5, 0.0)];
    points.extend_from_slice(&corners[1..]);
    points.push((overlap.clamp(2.0, side), 0.0));
    Run::record(plan, robot, &points, seed)
}

/// A hall of `width` x `depth` metres with pillars on an irregular grid and a few stands, driven in
/// a spiral: long ranges, many beams without return for short-sighted lasers.
pub fn hall(seed: u64, width: f64, depth: f64, robot: &Robot) -> Run {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut plan = FloorPlan::new();
    plan.rectangle((0.0, 0.0), (width, depth));
    let way: Vec<_> = [0.12, 0.3, 0.12]
        .iter()
        .flat_map(|&m| {
            let (x0, y0, x1, y1) = (m * width, m * depth, (1.0 - m) * width, (1.0 - m) * depth);
            [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0 + 0.05 * depth)]
        })
        .collect();
    let mut route = FloorPlan::new();
    route.polyline(&way);
    let (columns, rows) = ((width / 8.0) as usize, (depth / 8.0) as usize);
    for column in 1..columns.max(1) {
        for row in 1..rows.max(1) {
            let x = 8.0 * column as f64 + rng.random_range(-1.0..1.0);
            let y = 8.0 * row as f64 + rng.random_range(-1.0..1.0);
            if route.clearance(nalgebra::Vector2::new(x, y)) > 0.8 {
                plan.pillar((x, y), rng.random_range(0.15..0.4));
            }
        }
    }
    furnish(&mut plan, rng, (2.0, 2.0), (width - 2.0, depth - 2.0), &way);
    Run::record(plan, robot, &way, seed)
}
