//! Surface lines of exact scans against the walls themselves.

use geometry::{Pose2, Vector2};
use manifoldslam_matching::{BeamNoise, LineExtractor, LineFitSettings, LinePoint};
use rand::{SeedableRng, rngs::StdRng};
use sensing::Scan;
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
