//! Oracles for the synthetic worlds: fast against exhaustive ray casting, noise against its own
//! statistics, robots against walls, written logs against what they were written from.

mod campus;
mod teams;

use geometry::{LieGroup, Pose2, Vector2};
use manifoldslam_synthetic as synthetic;
use rand::{Rng, SeedableRng, rngs::StdRng};
use synthetic::{
    LaserNoise, RayCaster, Robot, Run, Scanner, WheelNoise, hall, noisy_room, noisy_room_pair,
    office, ring_corridor, two_loop_building, write_carmen, write_relations,
};

#[test]
fn grid_cast_equals_exhaustive_cast() {
    let worlds = [
        RayCaster::new(noisy_room(5)),
        RayCaster::new(two_loop_building(2).plan),
        RayCaster::new(synthetic::corridor(30.0, 2.0)),
    ];
    let mut rng = StdRng::seed_from_u64(1);
    for world in &worlds {
        let (lo, hi) = world.plan().bounds();
        for i in 0..4000 {
            let o = Vector2::new(
                rng.random_range(lo.x - 3.0..hi.x + 3.0),
                rng.random_range(lo.y - 3.0..hi.y + 3.0),
            );
            // Every eighth ray runs along an axis, where grid walks go wrong.
            let angle = if i % 8 == 0 {
                f64::from(i / 8) * std::f64::consts::FRAC_PI_2
            } else {
                rng.random_range(-4.0..4.0)
            };
            let d = Vector2::new(angle.cos(), angle.sin());
            let fast = world.cast(o, d, 25.0);
            let slow = world.cast_exhaustively(o, d, 25.0);
            assert_eq!(fast.map(|h| h.range), slow.map(|h| h.range), "ray {i} from {o:?}");
        }
    }
}

#[test]
fn normals_face_the_laser_and_hits_lie_on_surfaces() {
    let world = RayCaster::new(noisy_room(3));
    let scanner = Scanner::half_circle(361, LaserNoise::NONE);
    let pose = Pose2::new(0.3, -0.2, 1.0);
    for beam in scanner.truth(&world, &pose).into_iter().flatten() {
        let ray = Vector2::new(beam.bearing.cos(), beam.bearing.sin());
        assert!(beam.normal.dot(&ray) < 0.0 && (beam.normal.norm() - 1.0).abs() < 1e-12);
        assert!(world.plan().clearance(pose.transform(ray * beam.range)) < 1e-9);
    }
}

#[test]
fn range_noise_has_its_standard_deviation() {
    let world = RayCaster::new(noisy_room(4));
    let scanner = Scanner::half_circle(361, LaserNoise::gaussian(0.02));
    let truth = scanner.truth(&world, &Pose2::IDENTITY);
    let mut rng = StdRng::seed_from_u64(9);
    let (mut sum, mut n) = (0.0, 0.0);
    for _ in 0..20 {
        let scan = scanner.scan(&world, &Pose2::IDENTITY, &mut rng);
        for (i, beam) in truth.iter().enumerate() {
            if let (Some(beam), Some(range)) = (beam, scan.hit(i)) {
                sum += (f64::from(range) - beam.range).powi(2);
                n += 1.0;
            }
        }
    }
    assert!(((sum / n).sqrt() - 0.02).abs() < 0.001);
}

#[test]
fn wheel_noise_does_not_depend_on_the_step() {
    let noise = WheelNoise { distance_scale: 0.0, yaw_drift: 0.0, ..WheelNoise::default() };
    let spread = |steps: usize| {
        let mut rng = StdRng::seed_from_u64(7);
        let step = Pose2::new(10.0 / steps as f64, 0.0, 0.0);
        let yaws = (0..400).map(|_| {
            (0..steps).fold(Pose2::IDENTITY, |p, _| p * noise.measure(&step, &mut rng)).yaw
        });
        (yaws.map(|y| y * y).sum::<f64>() / 400.0).sqrt()
    };
    let expected = noise.yaw_per_metre * 10f64.sqrt();
    assert!((spread(10) / expected - 1.0).abs() < 0.12);
    assert!((spread(200) / expected - 1.0).abs() < 0.12);
}

#[test]
fn robots_keep_clear_of_walls_and_see_something() {
    let robot = Robot::default();
    let runs: [(&str, Run); 5] = [
        ("two loops 1", two_loop_building(1)),
        ("two loops 2", two_loop_building(2)),
        ("office", office(1, 2, &robot)),
        ("ring", ring_corridor(1, 200.0, 15.0, 10.0, &robot)),
        ("hall", hall(1, 60.0, 40.0, &robot)),
    ];
    for (name, run) in &runs {
        for (i, (pose, seen)) in run.truth.iter().zip(&run.observations).enumerate() {
            let clearance = run.plan.clearance(pose.translation());
            assert!(clearance > 0.2, "{name}: scan {i} at {pose:?} is {clearance} m from a wall");
            assert!(seen.scan.hit_count() > 60, "{name}: scan {i} at {pose:?}");
        }
        let odometry_error = run.truth[0]
            .between(run.truth.last().unwrap())
            .between(&run.observations.last().unwrap().odom_from_base.unwrap())
            .log();
        println!(
            "{name}: {} scans, {:.0} m, odometry off by {:.2} m, {:.1} deg",
            run.truth.len(),
            run.path_length(),
            odometry_error.xy().norm(),
            odometry_error.z.to_degrees()
        );
    }
    assert!((400..=1100).contains(&runs[0].1.truth.len()));
}

#[test]
fn same_seed_same_run_other_seed_other_run() {
    assert_eq!(two_loop_building(3), two_loop_building(3));
    assert_ne!(two_loop_building(3).observations, two_loop_building(4).observations);
    let scanner = Scanner::half_circle(181, LaserNoise::default());
    let pair = noisy_room_pair(8, &scanner, 0.3, 0.2);
    assert!((pair.truth().norm() - 0.3).abs() < 1e-9);
    assert!((pair.truth().yaw.abs() - 0.2).abs() < 1e-9);
}

#[test]
fn carmen_text_reads_back() {
    let mut robot = Robot::default();
    robot.scanner.base_from_laser = Pose2::new(0.2, 0.0, 0.0);
    let run = synthetic::corridor_run(1, 12.0, 3.0, &robot);
    let mut text = Vec::new();
    write_carmen(&run, &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("FLASER")).collect();
    assert_eq!(lines.len(), run.observations.len());
    for (line, observation) in lines.iter().zip(&run.observations) {
        let fields: Vec<f64> = line.split(' ').filter_map(|f| f.parse().ok()).collect();
        let n = observation.scan.len();
        assert_eq!(fields.len(), 1 + n + 6 + 2);
        for beam in 0..n {
            if let Some(range) = observation.scan.hit(beam) {
                assert!((fields[1 + beam] - f64::from(range)).abs() < 0.0051);
            }
        }
        let pose = |at: usize| Pose2::new(fields[at], fields[at + 1], fields[at + 2]);
        assert!(pose(n + 4).between(&pose(n + 1)).distance(&robot.scanner.base_from_laser) < 1e-5);
        assert!((fields[n + 7] - observation.stamp.as_secs()).abs() < 1e-6);
    }
}

#[test]
fn relations_compose_to_the_truth_and_close_loops() {
    let run = two_loop_building(1);
    let mut text = Vec::new();
    write_relations(&run, 10, &mut text).unwrap();
    let (mut near, mut far) = (0, 0);
    for line in String::from_utf8(text).unwrap().lines() {
        let f: Vec<f64> = line.split(' ').map(|f| f.parse().unwrap()).collect();
        assert_eq!(f.len(), 8);
        let at = |t: f64| {
            let index = run.observations.iter().position(|o| (o.stamp.as_secs() - t).abs() < 1e-5);
            run.truth[index.expect("a stamp of the log")]
        };
        let truth = at(f[0]).between(&at(f[1]));
        assert!(truth.distance(&Pose2::new(f[2], f[3], 0.0)) < 2e-6);
        if f[1] - f[0] > 30.0 {
            far += 1;
        } else {
            near += 1;
        }
    }
    assert!(near > 30 && far > 10, "{near} near and {far} far relations");
}
