use manifoldslam_synthetic::FloorPlan;
use rand::{Rng, rngs::StdRng};

/// How a corridor's walls look.
#[derive(Clone, Copy)]
pub struct WallStyle {
    /// Mean distance between things on the wall, metres.
    pub spacing: f64,
    /// Share of them that are open rooms; the others are door niches and boxes.
    pub rooms: f64,
}

/// A wall from `from` to `to` with door niches, rooms and boxes; the corridor lies on its left.
pub fn corridor_wall(
    plan: &mut FloorPlan,
    rng: &mut StdRng,
    from: (f64, f64),
    to: (f64, f64),
    style: WallStyle,
) {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let length = dx.hypot(dy);
    let (ux, uy) = (dx / length, dy / length);
    // Depth is counted away from the corridor, to the right of the way.
    let at = |along: f64, depth: f64| {
        (from.0 + ux * along + uy * depth, from.1 + uy * along - ux * depth)
    };
    let mut corners = vec![from];
    let mut along = 2.0 + style.spacing * rng.random_range(0.2..1.0);
    while along < length - 5.0 {
        let kind: f64 = rng.random();
        let width = rng.random_range(0.85..1.05);
        if kind < style.rooms {
            let (left, right, deep) = (
                rng.random_range(0.3..1.5),
                rng.random_range(0.3..1.5),
                rng.random_range(2.5..5.0),
            );
            let outline = [
                (0.0, 0.0),
                (0.0, 0.15),
                (-left, 0.15),
                (-left, deep),
                (width + right, deep),
                (width + right, 0.15),
                (width, 0.15),
                (width, 0.0),
            ];
            corners.extend(outline.map(|(s, d)| at(along + s, d)));
        } else if kind < style.rooms + 0.8 * (1.0 - style.rooms) {
            let deep = rng.random_range(0.08..0.25);
            let outline = [(0.0, 0.0), (0.0, deep), (width, deep), (width, 0.0)];
            corners.extend(outline.map(|(s, d)| at(along + s, d)));
        } else {
            let out = -rng.random_range(0.1..0.35);
            let outline = [(0.0, 0.0), (0.0, out), (0.6, out), (0.6, 0.0)];
            corners.extend(outline.map(|(s, d)| at(along + s, d)));
        }
        along += width + 3.2 * style.rooms + style.spacing * rng.random_range(0.4..1.6);
    }
    corners.push(to);
    plan.polyline(&corners);
}

/// A grid of corridors `width` wide whose centre lines run along `xs` and `ys`, every block between
/// them solid but for niches and rooms.
pub fn corridor_grid(
    rng: &mut StdRng,
    xs: &[f64],
    ys: &[f64],
    width: f64,
    style: WallStyle,
) -> FloorPlan {
    let mut plan = FloorPlan::new();
    let half = 0.5 * width;
    let ring =
        |low: (f64, f64), high: (f64, f64)| [low, (high.0, low.1), high, (low.0, high.1), low];
    let (x0, x1) = (xs[0] - half, xs[xs.len() - 1] + half);
    let (y0, y1) = (ys[0] - half, ys[ys.len() - 1] + half);
    for side in ring((x0, y0), (x1, y1)).windows(2) {
        corridor_wall(&mut plan, rng, side[0], side[1], style);
    }
    for x in xs.windows(2) {
        for y in ys.windows(2) {
            let block = ring((x[0] + half, y[0] + half), (x[1] - half, y[1] - half));
            for side in block.windows(2) {
                corridor_wall(&mut plan, rng, side[1], side[0], style);
            }
        }
    }
    plan
}

/// A corridor of `rooms` look-alike rooms on either side, each 3.6 x 5 m with a desk and a
/// cupboard; and the way in and out of every second of them, there and back.
pub fn office_wing(rng: &mut StdRng, rooms: usize) -> (FloorPlan, Vec<(f64, f64)>) {
    let mut plan = FloorPlan::new();
    let length = 3.6 * rooms as f64;
    plan.rectangle((0.0, -5.0), (length, 7.2));
    let doors: Vec<Vec<(f64, f64)>> = (0..2)
        .map(|_| (0..rooms).map(|i| (3.6 * i as f64 + rng.random_range(0.9..1.6), 0.9)).collect())
        .collect();
    plan.partition((0.0, 0.0), (length, 0.0), &doors[0]);
    plan.partition((0.0, 2.2), (length, 2.2), &doors[1]);
    for i in 1..rooms {
        let x = 3.6 * i as f64;
        plan.partition((x, -5.0), (x, 0.0), &[]).partition((x, 2.2), (x, 7.2), &[]);
    }
    for i in 0..rooms {
        for (y, inward) in [(-4.6, 1.0), (6.8, -1.0)] {
            let x = 3.6 * i as f64;
            plan.block((x + rng.random_range(1.2..2.2), y), (1.6, 0.7), 0.0);
            plan.block((x + 3.2, y + inward * rng.random_range(0.8..2.2)), (0.5, 1.0), 0.0);
            plan.legs((x + 0.7, y + inward * 1.2), (0.45, 0.45), rng.random_range(-0.8..0.8));
        }
    }
    let mut way = vec![(1.0, 1.1)];
    for (i, pair) in doors[0].iter().zip(&doors[1]).enumerate() {
        let side = i % 2;
        if i % 3 == 1 {
            continue;
        }
        let x = if side == 0 { pair.0.0 } else { pair.1.0 } + 0.45;
        let (door_y, inner_y) = if side == 0 { (0.0, -2.4) } else { (2.2, 4.6) };
        way.extend([
            (x, 1.1),
            (x, door_y),
            (x, inner_y),
            (x + 0.3, inner_y),
            (x, door_y),
            (x, 1.1),
        ]);
    }
    way.extend([
        (length - 1.0, 1.1),
        (length - 1.5, 1.2),
        (1.0, 1.0),
        (1.5, 1.2),
        (0.5 * length, 1.1),
    ]);
    (plan, way)
}
