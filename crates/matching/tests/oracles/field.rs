//! The surfel field and the fast matcher on it: kept against laid anew, analytic against numeric.

use crate::lines::extractor;
use geometry::{LieGroup, Matrix3, Pose2, Vector3};
use manifoldslam_matching::{
    FastMatcher, FastSettings, FieldSettings, LinePoint, MatchStatus, Prior, SurfelField,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use synthetic::{FloorPlan, LaserNoise, RayCaster, Scanner, corridor, noisy_room};

const WINDOW: ((f64, f64), (f64, f64)) = ((-25.0, -25.0), (25.0, 25.0));

fn empty() -> SurfelField {
    SurfelField::new(FieldSettings::default(), WINDOW.0, WINDOW.1)
}

/// Line points of noisy scans taken at `poses`, each in its own frame.
fn scans(world: &RayCaster, poses: &[Pose2], seed: u64) -> Vec<Vec<LinePoint>> {
    let scanner = Scanner::half_circle(361, LaserNoise::gaussian(0.01));
    let mut rng = StdRng::seed_from_u64(seed);
    poses
        .iter()
        .map(|pose| extractor().extract(&scanner.scan(world, pose, &mut rng), &Pose2::IDENTITY))
        .collect()
}

/// A small walk through a room.
fn walk() -> Vec<Pose2> {
    (0..8).map(|i| Pose2::new(0.1 * f64::from(i), 0.05, 0.15 * f64::from(i))).collect()
}

/// Everything a field tells about a scan at a pose.
fn told(field: &SurfelField, scan: &[LinePoint], pose: &Pose2) -> [u64; 13] {
    let (information, gradient, inliers) = FastMatcher::default().quadratic(field, scan, pose, 0.1);
    let mut all = information.iter().chain(gradient.iter()).chain(std::iter::once(&inliers));
    std::array::from_fn(|_| all.next().expect("13 numbers").to_bits())
}

#[test]
fn a_kept_field_is_the_field_laid_anew() {
    let world = RayCaster::new(noisy_room(7));
    let poses = walk();
    let scans = scans(&world, &poses, 7);
    let mut kept = empty();
    let mut reused = SurfelField::new(FieldSettings::default(), (-3.0, -9.0), (40.0, 2.0));
    for n in 1..scans.len() {
        kept.insert(&scans[n - 1], &poses[n - 1]);
        let mut fresh = empty();
        reused.reset(WINDOW.0, WINDOW.1);
        for field in [&mut fresh, &mut reused] {
            for (scan, pose) in scans.iter().zip(&poses).take(n) {
                field.insert(scan, pose);
            }
        }
        assert_eq!(kept.surfel_count(), fresh.surfel_count());
        let guess = Prior::guess(poses[n] * Pose2::new(0.05, -0.03, 0.04));
        let matcher = FastMatcher::default();
        let expected = matcher.align(&fresh, &scans[n], &guess);
        for field in [&kept, &reused] {
            assert_eq!(matcher.align(field, &scans[n], &guess), expected);
            for pose in &poses {
                assert_eq!(told(field, &scans[n], pose), told(&fresh, &scans[n], pose));
            }
        }
        assert_eq!(expected.status, MatchStatus::Converged);
        let error = expected.pose.between(&poses[n]);
        assert!(error.norm() < 0.02 && error.yaw.abs() < 0.005, "{error:?}");
    }
}

/// `sum of 1/2 kernel^2 r^2 / (kernel^2 + r^2) / variance` by one point and one surface: what the
/// matcher minimises, where the nearest surfel is never in doubt.
#[test]
fn the_gradient_is_the_derivative_of_the_robust_cost() {
    // One straight wall, exactly known: every surfel lies on the line y = 2.
    let wall: Vec<LinePoint> = (0..600)
        .map(|i| LinePoint {
            x: -3.0 + 0.01 * i as f32,
            y: 2.0,
            ny: -1.0,
            variance: 1e-4,
            normal_variance: 1e-12,
            ..LinePoint::default()
        })
        .collect();
    let mut field = empty();
    field.insert(&wall, &Pose2::IDENTITY);
    let scan: Vec<LinePoint> = wall.iter().skip(100).step_by(37).copied().collect();
    let kernel = 0.08;
    // A surfel's variance is that of its points by their number, and the roughness.
    let share = wall.len() as f64 / field.surfel_count() as f64;
    let variance = 1e-4 + 1e-4 / share + f64::from(field.settings().roughness_m).powi(2);
    let cost = |pose: &Pose2| -> f64 {
        let residuals =
            scan.iter().map(|p| pose.transform([p.x.into(), p.y.into()].into()).y - 2.0);
        let k2 = f64::powi(kernel, 2);
        residuals.map(|r| 0.5 * k2 * r * r / (k2 + r * r) / variance).sum()
    };
    for pose in [Pose2::new(0.02, 0.04, 0.01), Pose2::new(-0.3, -0.05, -0.02)] {
        let matcher = FastMatcher::default();
        let (_, gradient, _) = matcher.quadratic(&field, &scan, &pose, kernel as f32);
        let h = 1e-6;
        let numeric: Vec<f64> = (0..3)
            .map(|axis| {
                let mut step = Vector3::zeros();
                step[axis] = h;
                (cost(&pose.retract(&step)) - cost(&pose.retract(&-step))) / (2.0 * h)
            })
            .collect();
        let numeric = Vector3::from_column_slice(&numeric);
        // The last surfels are only partly filled; f32 sums.
        let error = (gradient - numeric).norm() / numeric.norm();
        assert!(error < 0.01, "{gradient:?} {numeric:?}");
    }
}

#[test]
fn a_scan_lies_on_itself() {
    for seed in 0..6 {
        let world = RayCaster::new(noisy_room(seed));
        let scan = &scans(&world, &[Pose2::IDENTITY], seed)[0];
        let mut field = empty();
        field.insert(scan, &Pose2::IDENTITY);
        let guess = Prior::guess(Pose2::new(0.06, -0.05, 0.04));
        let found = FastMatcher::default().align(&field, scan, &guess);
        assert_eq!(found.status, MatchStatus::Converged);
        assert!(found.pose.norm() < 2e-3 && found.pose.yaw.abs() < 4e-4, "{:?}", found.pose);
        assert!(found.inlier_ratio > 0.9);
    }
}

/// Cells lie differently in a turned field, so that surfels average other points: the answers agree
/// within what the noise leaves open.
#[test]
fn moving_field_and_scan_moves_the_answer() {
    let matcher = FastMatcher::default();
    for seed in 0..6 {
        let world = RayCaster::new(noisy_room(seed));
        let poses = walk();
        let scans = scans(&world, &poses, seed);
        let answer = |field_motion: Pose2, scan_motion: Pose2| {
            let mut field = empty();
            for (scan, pose) in scans.iter().zip(&poses).take(5) {
                field.insert(scan, &(field_motion * *pose));
            }
            let turned = LinePoint::mover(&scan_motion);
            let scan: Vec<LinePoint> = scans[5].iter().map(turned).collect();
            let guess = field_motion * poses[5] * scan_motion.inverse();
            let found = matcher.align(&field, &scan, &Prior::guess(guess));
            field_motion.inverse() * found.pose * scan_motion
        };
        let plain = answer(Pose2::IDENTITY, Pose2::IDENTITY);
        // The scan's own frame matters to rounding alone.
        let scan_moved = plain.between(&answer(Pose2::IDENTITY, Pose2::new(-0.5, 2.0, -0.8)));
        assert!(scan_moved.norm() < 1e-3 && scan_moved.yaw.abs() < 2e-4, "{seed}: {scan_moved:?}");
        for motion in [Pose2::new(3.0, -1.0, 0.4), Pose2::new(0.03, 0.07, 2.5)] {
            let moved = plain.between(&answer(motion, Pose2::IDENTITY));
            assert!(moved.norm() < 4e-3 && moved.yaw.abs() < 1e-3, "{seed}: {moved:?}");
        }
    }
}

/// The noise of a wall along a border of cells puts its points into two rows of cells; its surfels
/// are still one row, each of them all of the noise and not its near or its far half.
#[test]
fn a_wall_along_a_border_of_cells_is_one_row_of_surfels() {
    let mut rng = StdRng::seed_from_u64(8);
    let std = 0.015;
    for y in [2.0f32, 2.03, 2.05] {
        let mut wall = |y: f32| -> Vec<LinePoint> {
            let point = |i| LinePoint {
                x: -2.0 + 0.001 * i as f32,
                y: y + std * synthetic::standard_normal(&mut rng) as f32,
                ny: -1.0,
                variance: std * std,
                normal_variance: 1e-3,
                ..LinePoint::default()
            };
            (0..4000).map(point).collect()
        };
        let mut field = empty();
        field.insert(&wall(y), &Pose2::IDENTITY);
        let most = 4.0 / field.settings().cell_m + 2.0;
        assert!(field.surfel_count() as f32 <= most, "{y}: {} surfels", field.surfel_count());
        let shifted = wall(y + 0.008);
        let found = FastMatcher::default().align(&field, &shifted, &Prior::guess(Pose2::IDENTITY));
        assert!((found.pose.y + 0.008).abs() < 0.002, "{y}: {:?}", found.pose);
    }
}

#[test]
fn a_corridor_leaves_its_axis_open() {
    let world = RayCaster::new(corridor(60.0, 2.0));
    let noise = LaserNoise { max_range: 8.0, ..LaserNoise::gaussian(0.01) };
    let scanner = Scanner::half_circle(361, noise);
    let mut rng = StdRng::seed_from_u64(3);
    for yaw in [0.0, 0.3, 1.2] {
        let pose = Pose2::new(0.0, 0.1, yaw);
        let mut take =
            || extractor().extract(&scanner.scan(&world, &pose, &mut rng), &Pose2::IDENTITY);
        let mut field = empty();
        field.insert(&take(), &pose);
        let found = FastMatcher::default().align(&field, &take(), &Prior::guess(pose));
        let axis = Vector3::new(yaw.cos(), -yaw.sin(), 0.0);
        let across = Vector3::new(yaw.sin(), yaw.cos(), 0.0);
        let std = |v: &Vector3<f64>| v.dot(&(found.covariance * v)).sqrt();
        assert!(std(&axis) > 10.0 * std(&across), "yaw {yaw}: {} {}", std(&axis), std(&across));
        if let MatchStatus::Degenerate { weak_axis } = found.status {
            assert!(weak_axis.dot(&axis).abs() > 0.99, "yaw {yaw}: {weak_axis:?}");
        }
    }
}

#[test]
fn sight_is_blocked_by_walls_that_face_it() {
    let mut plan = FloorPlan::new();
    plan.wall((-4.0, 3.0), (4.0, 3.0));
    let scan = &scans(&RayCaster::new(plan), &[Pose2::new(0.0, 0.0, 1.57)], 1)[0];
    let mut field = empty();
    field.insert(scan, &Pose2::new(0.0, 0.0, 1.57));
    for x in [-2.0f32, -0.3, 1.1] {
        assert!(field.blocks((x, 0.0), (x + 0.4, 6.0), 0.1), "through the wall at {x}");
        assert!(!field.blocks((x, 0.0), (x + 0.4, 2.6), 0.1), "short of it");
        assert!(!field.blocks((x, 6.0), (x + 0.4, 0.0), 0.1), "its back was never seen");
        assert!(!field.blocks((x, 3.5), (x, 6.0), 0.1), "behind it");
    }
    assert!(!field.blocks((10.0, 0.0), (10.0, 6.0), 0.1), "past its end");
    assert!(!field.blocks((0.0, 0.0), (f32::NAN, 6.0), 0.1), "nowhere");
    assert!(field.blocks((0.0, 0.0), (0.0, 1e3), 0.1), "far beyond the field");
}

#[test]
fn garbage_points_never_panic_nor_give_nan() {
    let mut rng = StdRng::seed_from_u64(5);
    let mut garbage = |n: usize| -> Vec<LinePoint> {
        let mut number = |scale: f32| match rng.random_range(0..30) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => 0.0,
            3 => rng.random_range(-1e38..1e38),
            _ => rng.random_range(-scale..scale),
        };
        (0..n)
            .map(|_| LinePoint {
                x: number(6.0),
                y: number(6.0),
                nx: number(1.0),
                ny: number(1.0),
                variance: number(1e-3),
                normal_variance: number(1e-3),
            })
            .collect()
    };
    let matcher = FastMatcher { settings: FastSettings::default() };
    for round in 0..80 {
        let mut field = empty();
        field.insert(&garbage(10 + 9 * round), &Pose2::IDENTITY);
        let information = if round % 2 == 0 { Matrix3::zeros() } else { Matrix3::identity() * 1e3 };
        let prior = Prior { pose: Pose2::IDENTITY, information };
        let found = matcher.align(&field, &garbage(400 - 5 * round), &prior);
        assert!(LieGroup::is_finite(&found.pose), "{round}: {found:?}");
        assert!(found.covariance.iter().all(|v| v.is_finite()), "{round}: {found:?}");
        assert!((0.0..=1.0).contains(&found.inlier_ratio), "{round}: {found:?}");
    }
}
