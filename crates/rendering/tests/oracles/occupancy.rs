use crate::worlds::{
    cast, full_circle, grid, poses_in_square, recorded, square_scan, views, with_threads,
};
use geometry::{Pose2, Vector2};
use manifoldslam_rendering::{Cell, GridFrame, HitMissCounts, OccupancyGrid, OccupancyRule};
use sensing::Scan;
use synthetic::standard_normal;

fn square(half: f64, resolution: f64) -> GridFrame {
    GridFrame::covering(Vector2::repeat(-half), Vector2::repeat(half), resolution).expect("ok")
}

/// Which way a cell lies from the centre, and how deep inside the room.
fn cells(frame: GridFrame) -> impl Iterator<Item = (usize, usize, Vector2<f64>)> {
    (0..frame.height)
        .flat_map(move |r| (0..frame.width).map(move |c| (c, r)))
        .map(move |(c, r)| (c, r, frame.center(c, r)))
}

/// A room without noise whose walls run through the middle of cells: walls one cell thick, closed,
/// and everything inside free, outside unknown.
#[test]
fn an_exact_room_is_drawn_exactly() {
    let resolution = 0.05;
    let half = 3.0 + 0.5 * resolution;
    let poses = poses_in_square(half);
    let scans: Vec<Scan> = poses.iter().map(|p| square_scan(p, full_circle(720), half)).collect();
    let frame = square(4.0, resolution);
    let grid = grid(frame, &views(&scans, &poses));
    for (c, r, center) in cells(frame) {
        let depth = half - center.amax();
        // Beams end beside the corner, not in it.
        let corner = (half - center.x.abs()).max(half - center.y.abs()) < 1.5 * resolution;
        let expected = if depth.abs() < 0.5 * resolution {
            Cell::Occupied
        } else if depth > 0.0 {
            Cell::Free
        } else {
            Cell::Unknown
        };
        assert!(corner || grid.cell(c, r) == expected, "{center} is {:?}", grid.cell(c, r));
    }
}

fn noisy_scans(poses: &[Pose2], half: f64, noise: f64, seed: u64) -> Vec<Scan> {
    use rand::SeedableRng;
    let mut rng = rand::rngs::StdRng::seed_from_u64(seed);
    let laser = full_circle(360);
    poses
        .iter()
        .map(|pose| {
            let exact = square_scan(pose, laser, half);
            let range = |i| exact.range(i) + (noise * standard_normal(&mut rng)) as f32;
            Scan::classify(laser, &(0..exact.len()).map(range).collect::<Vec<_>>())
        })
        .collect()
}

/// With 2 cm of noise, walls stay within two cells, closed and straight; nothing stands inside.
#[test]
fn noisy_walls_stay_thin_and_closed() {
    let (half, resolution) = (3.01, 0.025);
    let poses: Vec<Pose2> = poses_in_square(half).into_iter().cycle().take(60).collect();
    let scans = noisy_scans(&poses, half, 0.02, 7);
    let frame = square(3.5, resolution);
    let grid = grid(frame, &views(&scans, &poses));
    let mut thickness = 0;
    let reach = (0.9 * half / resolution) as usize;
    let middle = frame.width / 2;
    for c in middle - reach..middle + reach {
        let upper: Vec<usize> =
            (middle..frame.height).filter(|&r| grid.cell(c, r) == Cell::Occupied).collect();
        assert!(!upper.is_empty(), "hole in column {c}");
        assert!(upper.len() <= 4, "wall {} cells thick in column {c}", upper.len());
        thickness += upper.len();
        for r in upper {
            assert!((frame.center(c, r).y - half).abs() < 0.06);
        }
    }
    let mean = thickness as f64 / (2 * reach) as f64;
    assert!(mean < 2.5, "walls are {mean} cells thick");
    let clear = cells(frame).filter(|(_, _, p)| p.amax() < half - 0.1);
    assert!(clear.into_iter().all(|(c, r, _)| grid.cell(c, r) == Cell::Free));
}

/// One beam that ends in mid-air and one person who walks by leave nothing in a room seen often.
#[test]
fn passers_by_vanish() {
    let half = 3.0;
    let poses: Vec<Pose2> = poses_in_square(half).into_iter().cycle().take(20).collect();
    let mut scans = noisy_scans(&poses, half, 0.01, 3);
    for (k, scan) in scans.iter_mut().enumerate().take(4) {
        let mut ranges: Vec<f32> = (0..scan.len()).map(|i| scan.range(i)).collect();
        ranges[90 * k..90 * k + 15].iter_mut().for_each(|r| *r *= 0.5);
        *scan = Scan::classify(*scan.laser(), &ranges);
    }
    let frame = square(4.0, 0.05);
    let grid = grid(frame, &views(&scans, &poses));
    let inside = cells(frame).filter(|(_, _, p)| p.amax() < half - 0.15);
    let standing = inside.into_iter().filter(|&(c, r, _)| grid.cell(c, r) == Cell::Occupied);
    assert_eq!(standing.count(), 0);
}

/// Walls do not grow with the number of scans that saw them.
#[test]
fn long_looks_do_not_thicken_walls() {
    let (half, frame) = (3.01, square(3.5, 0.025));
    let count = |scans: usize| {
        let poses: Vec<Pose2> = poses_in_square(half).into_iter().cycle().take(scans).collect();
        let scans = noisy_scans(&poses, half, 0.02, 11);
        grid(frame, &views(&scans, &poses)).count(Cell::Occupied) as f64
    };
    let (few, many) = (count(60), count(1200));
    assert!(many < 1.15 * few, "{few} cells grew to {many}");
}

/// The rule as its documentation states it, cell by cell, without any cleverness.
fn decide_plainly(counts: &HitMissCounts, rule: &OccupancyRule) -> Vec<Cell> {
    let frame = *counts.frame();
    let (width, height) = (frame.width as isize, frame.height as isize);
    let around = |c: isize, r: isize, radius: isize| {
        let inside =
            move |(c, r): &(isize, isize)| (0..width).contains(c) && (0..height).contains(r);
        (-radius..=radius)
            .flat_map(move |dr| (-radius..=radius).map(move |dc| (c + dc, r + dr)))
            .filter(inside)
    };
    let at = |c: isize, r: isize| (r * width + c) as usize;
    let cells = |metres: f64| (metres / frame.resolution_m).round() as isize;
    let (blur, ridge) = (cells(rule.smoothing_m), cells(rule.ridge_radius_m));
    let all = || (0..height).flat_map(move |r| (0..width).map(move |c| (c, r)));
    let hits: Vec<f64> = all()
        .map(|(c, r)| {
            let sum = |(c, r)| f64::from(counts.hits(c as usize, r as usize));
            around(c, r, blur).map(sum).sum::<f64>() / (2 * blur + 1) as f64
        })
        .collect();
    let (mut decided, mut weak) = (vec![Cell::Unknown; frame.len()], Vec::new());
    for (c, r) in all() {
        let (i, misses) = (at(c, r), f64::from(counts.misses(c as usize, r as usize)));
        let peak = around(c, r, ridge).map(|(c, r)| hits[at(c, r)]).fold(0.0, f64::max);
        let share = hits[i] > 0.0 && hits[i] >= rule.wall_share * (hits[i] + misses);
        if share && hits[i] >= rule.ridge_share * peak {
            decided[i] = Cell::Occupied;
        } else {
            if misses > 0.0 && misses >= 0.1 * peak {
                decided[i] = Cell::Free;
            }
            if share && hits[i] >= rule.closing_share * peak {
                weak.push((c, r));
            }
        }
    }
    let ridges = decided.clone();
    for (c, r) in weak {
        let wall = |dc, dr| {
            let (c, r) = (c + dc, r + dr);
            (0..width).contains(&c)
                && (0..height).contains(&r)
                && ridges[at(c, r)] == Cell::Occupied
        };
        let between = |dc: isize, dr: isize| wall(dc, dr) && wall(-dc, -dr);
        if between(1, 0) || between(0, 1) || between(1, 1) || between(1, -1) {
            decided[at(c, r)] = Cell::Occupied;
        }
    }
    let closed = decided.clone();
    for (c, r) in all().filter(|&(c, r)| closed[at(c, r)] == Cell::Occupied) {
        let company = around(c, r, 1).filter(|&(c, r)| closed[at(c, r)] == Cell::Occupied).count();
        if company == 1 && counts.hits(c as usize, r as usize) < 2 {
            let free = counts.misses(c as usize, r as usize) > 0;
            decided[at(c, r)] = if free { Cell::Free } else { Cell::Unknown };
        }
    }
    decided
}

#[test]
fn decisions_follow_the_rule() {
    let (scans, poses) = recorded(8);
    let views: Vec<_> = views(&scans, &poses).into_iter().step_by(9).collect();
    let wide = OccupancyRule { ridge_radius_m: 0.15, smoothing_m: 0.05, ..Default::default() };
    for (resolution, rule) in [(0.05, OccupancyRule::default()), (0.03, wide)] {
        let counts = cast(GridFrame::around(&views, 0.0, resolution).expect("ok"), &views);
        let grid = OccupancyGrid::decide(&counts, &rule);
        let plain = OccupancyGrid::from_cells(*counts.frame(), decide_plainly(&counts, &rule));
        for (c, r, center) in cells(*counts.frame()) {
            assert_eq!(grid.cell(c, r), plain.cell(c, r), "{center}");
        }
    }
}

#[test]
fn decisions_do_not_depend_on_threads() {
    let (scans, poses) = recorded(2);
    let views = views(&scans, &poses);
    for resolution in [0.05, 0.02] {
        let frame = GridFrame::around(&views, 0.5, resolution).expect("a frame");
        let counts = cast(frame, &views);
        let decide = || OccupancyGrid::decide(&counts, &OccupancyRule::default());
        assert!(with_threads(1, decide) == with_threads(3, decide));
    }
}

/// Against the plan the scans were cast from: walls of the map lie on walls of the plan.
#[test]
fn recorded_walls_lie_on_the_plan() {
    let run = synthetic::two_loop_building(4);
    let (scans, poses) = recorded(4);
    let views = views(&scans, &poses);
    let frame = GridFrame::around(&views, 0.2, 0.025).expect("a frame");
    let grid = grid(frame, &views);
    let (mut walls, mut near, mut traversed) = (0, 0, 0);
    for (c, r, center) in cells(frame) {
        if grid.cell(c, r) == Cell::Occupied {
            walls += 1;
            near += u32::from(run.plan.clearance(center) < 0.06);
        }
    }
    for pose in &run.truth {
        let cell = frame.cells_from_map(pose.translation());
        traversed += u32::from(grid.cell(cell.x as usize, cell.y as usize) == Cell::Free);
    }
    assert!(walls > 3000);
    let share = f64::from(near) / f64::from(walls);
    assert!(share > 0.985, "{share} of {walls} wall cells lie on walls");
    assert_eq!(traversed as usize, run.truth.len());
}

#[test]
fn trimming_keeps_the_map_where_it_is() {
    let half = 3.0;
    let poses = poses_in_square(half);
    let scans: Vec<Scan> = poses.iter().map(|p| square_scan(p, full_circle(360), half)).collect();
    let whole = grid(square(20.0, 0.05), &views(&scans, &poses));
    let trimmed = whole.clone().trimmed(0.5);
    let size = trimmed.frame().upper_right() - trimmed.frame().origin;
    assert!(size.max() < 7.3 && size.min() > 6.7, "{size}");
    assert_eq!(trimmed.count(Cell::Occupied), whole.count(Cell::Occupied));
    assert_eq!(trimmed.count(Cell::Free), whole.count(Cell::Free));
    for (c, r, center) in cells(*trimmed.frame()) {
        let there = whole.frame().cells_from_map(center);
        assert_eq!(trimmed.cell(c, r), whole.cell(there.x as usize, there.y as usize));
    }
}
