//! Surface lines of exact scans against the walls themselves.

use geometry::{Pose2, Vector2};
use manifoldslam_matching::{BeamNoise, LineExtractor, LineFitSettings, LinePoint};
use rand::{SeedableRng, rngs::StdRng};
use sensing::{LaserModel, Scan, Sweep, Twist};
use synthetic::{FloorPlan, LaserNoise, RayCaster, Scanner, noisy_room};

pub fn extractor() -> LineExtractor {
    LineExtractor::new(BeamNoise::default(), LineFitSettings::default())
}

fn exact_scan(world: &RayCaster, pose: &Pose2) -> (Scanner, Scan) {
    let scanner = Scanner::half_circle(361, LaserNoise::NONE);
    let scan = scanner.scan(world, pose, &mut StdRng::seed_from_u64(1));
    (scanner, scan)
}

#[test]
fn exact_walls_have_exact_normals_towards_the_laser() {
    let mut plan = FloorPlan::new();
    plan.rectangle((-3.0, -2.0), (5.0, 4.0));
    let world = RayCaster::new(plan);
    for pose in [Pose2::IDENTITY, Pose2::new(1.0, 1.0, 0.7), Pose2::new(-1.0, 2.5, -2.0)] {
        let (scanner, scan) = exact_scan(&world, &pose);
        let truth = scanner.truth(&world, &pose);
        let points = extractor().extract(&scan, &Pose2::IDENTITY);
        assert!(points.len() > 340, "{} of 361", points.len());
        for p in &points {
            let (position, normal) = (Vector2::new(p.x, p.y).cast::<f64>(), normal_of(p));
            let bearing = position.y.atan2(position.x);
            let beam = truth
                .iter()
                .flatten()
                .min_by(|a, b| (a.bearing - bearing).abs().total_cmp(&(b.bearing - bearing).abs()));
            let beam = beam.expect("a room is closed");
            assert!((normal.norm() - 1.0).abs() < 1e-6);
            assert!(normal.dot(&position) < 0.0, "towards the laser");
            // Ranges are f32, so that a fit over 20 cm is good to some microradians. Around a
            // corner no single normal is right.
            let corner = truth.iter().flatten().any(|other| {
                other.normal.dot(&beam.normal) < 0.5 && (end(other) - position).norm() < 0.3
            });
            let error = normal.perp(&beam.normal).abs();
            assert!(corner || error < 1e-4, "{error} at {position:?}");
        }
    }
}

fn end(beam: &synthetic::TrueBeam) -> Vector2<f64> {
    Vector2::new(beam.bearing.cos(), beam.bearing.sin()) * beam.range
}

fn normal_of(p: &LinePoint) -> Vector2<f64> {
    Vector2::new(p.nx, p.ny).cast()
}

/// What the laser's mounting does to points, it does to the lines.
#[test]
fn a_mounting_moves_points_and_normals() {
    let world = RayCaster::new(noisy_room(3));
    let (_, scan) = exact_scan(&world, &Pose2::IDENTITY);
    let mounting = Pose2::new(0.2, -0.1, 0.5);
    let plain = extractor().extract(&scan, &Pose2::IDENTITY);
    let mounted = extractor().extract(&scan, &mounting);
    assert!(plain.len() == mounted.len() && plain.len() > 200);
    for (a, b) in plain.iter().zip(&mounted) {
        let expected = mounting.transform(Vector2::new(a.x, a.y).cast());
        assert!((expected - Vector2::new(b.x, b.y).cast()).norm() < 1e-5);
        assert!((mounting.rotate(normal_of(a)) - normal_of(b)).norm() < 1e-5);
        assert_eq!((a.variance, a.normal_variance), (b.variance, b.normal_variance));
    }
}

/// Bearings kept from the scan before must not be used for a scanner of another kind.
#[test]
fn an_extractor_remembers_nothing_of_other_scans() {
    let world = RayCaster::new(noisy_room(4));
    let mut kept = extractor();
    for beams in [361, 181, 0, 5, 721, 361] {
        let scanner = Scanner::half_circle(beams, LaserNoise::default());
        let scan = scanner.scan(&world, &Pose2::IDENTITY, &mut StdRng::seed_from_u64(2));
        let fresh = extractor().extract(&scan, &Pose2::IDENTITY);
        assert_eq!(kept.extract(&scan, &Pose2::IDENTITY), fresh, "{beams} beams");
    }
}

/// A wall with a doorway, seen from inside a room: both jambs are found, facing each other, to half
/// a beam's spacing.
#[test]
fn the_ends_of_walls_face_along_them() {
    let mut plan = FloorPlan::new();
    plan.rectangle((-3.0, -4.0), (9.0, 4.0))
        .wall((2.0, -4.0), (2.0, -0.5))
        .wall((2.0, 0.4), (2.0, 4.0));
    let world = RayCaster::new(plan);
    for pose in [Pose2::IDENTITY, Pose2::new(-1.0, 0.5, 0.3), Pose2::new(0.5, -0.2, -0.4)] {
        let (_, scan) = exact_scan(&world, &pose);
        let points = extractor().extract(&scan, &Pose2::IDENTITY);
        for (end, facing) in [((2.0, -0.5), 1.0), ((2.0, 0.4), -1.0)] {
            let found = points.iter().map(LinePoint::mover(&pose)).find(|p| {
                (p.x - end.0).abs() < 0.02 && (p.y - end.1).abs() < 0.04 && p.ny * facing > 0.99
            });
            assert!(found.is_some(), "{end:?} from {pose:?}");
        }
    }
}

/// A slow scanner on a turning robot: with the sweep known, walls are where they are; taken at
/// once, they are bent by centimetres.
#[test]
fn a_sweep_is_undone() {
    let mut plan = FloorPlan::new();
    plan.rectangle((-3.0, -2.0), (5.0, 4.0));
    let world = RayCaster::new(plan);
    let (pose, base_from_laser) = (Pose2::new(0.5, 0.3, 0.6), Pose2::new(0.2, 0.05, 0.1));
    let twist = Twist { forward_m_per_sec: 1.0, yaw_rad_per_sec: 1.0 };
    let sweep = Sweep { twist, duration_secs: 0.1, reference: 0.5 };
    let laser = LaserModel::half_circle(361);
    let readings: Vec<f32> = (0..361)
        .map(|i| {
            let from = pose * sweep.reference_from_beam(i, 361) * base_from_laser;
            let (sin, cos) = laser.bearing(i).sin_cos();
            let ray = from.rotate(Vector2::new(cos, sin));
            world.cast(from.translation(), ray, 40.0).expect("a room is closed").range as f32
        })
        .collect();
    let scan = Scan::classify(laser, &readings);
    // The few points in corners are drawn to a line across them.
    let nearly_all_and_worst = |sweep: Option<&Sweep>| {
        let points = extractor().extract_swept(&scan, &base_from_laser, sweep);
        assert!(points.len() > 340, "{} of 361", points.len());
        let off = points.iter().map(LinePoint::mover(&pose)).map(|p| {
            let walls = [p.x + 3.0, p.x - 5.0, p.y + 2.0, p.y - 4.0];
            walls.into_iter().map(f32::abs).fold(f32::INFINITY, f32::min)
        });
        let mut off: Vec<f32> = off.collect();
        off.sort_by(f32::total_cmp);
        (off[off.len() * 19 / 20], off[off.len() - 1])
    };
    let (nearly_all, worst) = nearly_all_and_worst(Some(&sweep));
    assert!(nearly_all < 1e-4 && worst < 0.02, "{nearly_all} {worst}");
    let (_, worst) = nearly_all_and_worst(None);
    assert!(worst > 0.05, "{worst}");
}
