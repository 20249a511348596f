use geometry::{Pose2, Vector2};
use manifoldslam_sensing::{DeskewSettings, LaserModel, Scan, Stamp, Sweep, Twist, Velocimeter};

/// Distance from `origin` along `direction` to the walls of a 12 x 8 m room around the world's
/// origin.
fn ray_to_room(origin: Vector2<f64>, direction: Vector2<f64>) -> f64 {
    let along = |o: f64, d: f64, wall: f64| if d > 0.0 { (wall - o) / d } else { (-wall - o) / d };
    along(origin.x, direction.x, 6.0).min(along(origin.y, direction.y, 4.0))
}

fn distance_to_room(p: Vector2<f64>) -> f64 {
    (6.0 - p.x.abs()).abs().min((4.0 - p.y.abs()).abs())
}

/// What a laser on a moving robot measures in the room, beam by beam.
fn moving_scan(sweep: &Sweep, world_from_reference: Pose2, base_from_laser: Pose2) -> Scan {
    let laser = LaserModel::half_circle(361);
    let readings: Vec<f32> = (0..361)
        .map(|i| {
            let t = (i as f64 / 360.0 - sweep.reference) * sweep.duration_secs;
            let world_from_laser = world_from_reference * sweep.twist.motion(t) * base_from_laser;
            let (sin, cos) = laser.bearing(i).sin_cos();
            let direction = world_from_laser.rotate(Vector2::new(cos, sin));
            ray_to_room(world_from_laser.translation(), direction) as f32
        })
        .collect();
    Scan::classify(laser, &readings)
}

/// Largest distance of the picture's points from the room's walls.
fn worst(sweep: &Sweep, scan: &Scan, world_from_reference: Pose2, base_from_laser: Pose2) -> f64 {
    let hits = sweep.deskew(scan, &base_from_laser);
    assert_eq!(hits.len(), 361);
    hits.iter()
        .map(|hit| distance_to_room(world_from_reference.transform(hit.endpoint)))
        .fold(0.0, f64::max)
}

#[test]
fn deskewing_puts_every_point_on_the_wall() {
    let world_from_reference = Pose2::new(0.7, -0.9, 0.4);
    let base_from_laser = Pose2::new(0.3, 0.1, -0.2);
    let twist = Twist { forward_m_per_sec: 1.5, yaw_rad_per_sec: 1.2 };
    for reference in [0.0, 0.5, 1.0] {
        let sweep = Sweep { twist, duration_secs: 0.1, reference };
        let scan = moving_scan(&sweep, world_from_reference, base_from_laser);
        assert!(worst(&sweep, &scan, world_from_reference, base_from_laser) < 1e-5);
        let still = Sweep { twist: Twist::default(), ..sweep };
        assert!(worst(&still, &scan, world_from_reference, base_from_laser) > 0.02);
    }
}

#[test]
fn a_robot_at_rest_changes_nothing() {
    let sweep = Sweep { twist: Twist::default(), duration_secs: 0.1, reference: 1.0 };
    let base_from_laser = Pose2::new(0.3, 0.1, -0.2);
    let scan = moving_scan(&sweep, Pose2::IDENTITY, base_from_laser);
    for hit in sweep.deskew(&scan, &base_from_laser) {
        assert_eq!(hit.origin, base_from_laser.translation());
        let i = hit.beam as usize;
        let (sin, cos) = scan.laser().bearing(i).sin_cos();
        let expected = base_from_laser.transform(Vector2::new(cos, sin) * f64::from(scan.range(i)));
        assert!((hit.endpoint - expected).norm() < 1e-12);
    }
}

#[test]
fn velocities_are_those_of_the_odometry() {
    let twist = Twist { forward_m_per_sec: 0.8, yaw_rad_per_sec: -0.6 };
    let mut meter = Velocimeter::default();
    let mut pose = Pose2::new(3.0, -2.0, 1.0);
    assert_eq!(meter.observe(Stamp::from_secs(10.0), Some(pose)), None, "the first scan");
    for i in 1..20 {
        pose = pose * twist.motion(0.2);
        let stamp = Stamp::from_secs(10.0 + 0.2 * f64::from(i));
        let told = meter.observe(stamp, Some(pose)).expect("odometry goes on");
        assert!((told.forward_m_per_sec - twist.forward_m_per_sec).abs() < 1e-9);
        assert!((told.yaw_rad_per_sec - twist.yaw_rad_per_sec).abs() < 1e-9);
    }
    let at = |secs: f64| Stamp::from_secs(secs);
    assert_eq!(meter.observe(at(13.5), Some(pose * Pose2::new(30.0, 0.0, 0.0))), None, "a jump");
    assert_eq!(meter.observe(at(12.0), Some(pose)), None, "a stamp that jumps back");
    assert_eq!(meter.observe(at(12.2), None), None, "no odometry");
    assert_eq!(meter.observe(at(12.4), Some(pose)), None, "odometry that has just come back");
    assert_eq!(meter.observe(at(90.0), Some(pose)), None, "a gap");
}

#[test]
fn scans_are_taken_as_they_are_unless_the_sweep_is_known() {
    let twist = Some(Twist::default());
    assert_eq!(DeskewSettings::default().sweep(twist), None);
    let settings = DeskewSettings { sweep_secs: 0.1, ..DeskewSettings::default() };
    assert_eq!(settings.sweep(None), None);
    assert_eq!(settings.sweep(twist).map(|s| s.duration_secs), Some(0.1));
}
