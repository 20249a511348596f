use geometry::{Pose2, Pose3, Vector2, Vector3};
use manifoldslam_sensing::{Attitude, BeamClass, LaserModel, Levelling, Scan};
use nalgebra::UnitQuaternion;
use proptest::prelude::*;

const HEIGHT_M: f64 = 0.3;

/// The base as it leans, above where it stands; its laser's plane is `HEIGHT_M` above its origin.
fn leaning(attitude: &Attitude) -> Pose3 {
    let Attitude { roll_rad, pitch_rad } = *attitude;
    Pose3::new(Vector3::zeros(), UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0))
}

proptest! {
    /// What is straight below or above in space is the same place on the plan; heights too.
    #[test]
    fn points_are_projected_as_in_space(
        roll_rad in -0.6..0.6, pitch_rad in -0.6..0.6, x in -20.0..20.0, y in -20.0..20.0,
    ) {
        let attitude = Attitude { roll_rad, pitch_rad };
        let levelling = Levelling::new(&attitude, HEIGHT_M);
        let space = leaning(&attitude).transform(Vector3::new(x, y, HEIGHT_M));
        let plan = levelling.project(Vector2::new(x, y));
        prop_assert!((plan - space.xy()).norm() < 1e-9);
        prop_assert!((levelling.height_m(Vector2::new(x, y)) - space.z).abs() < 1e-9);
        let up = levelling.uphill();
        let ahead = levelling.height_m(Vector2::new(x, y) + up);
        prop_assert!(ahead >= levelling.height_m(Vector2::new(x, y)) - 1e-12);
    }

    /// A normal stays one: whatever lies along a surface lies along it on the plan.
    #[test]
    fn normals_stay_normal(
        roll_rad in -0.6..0.6, pitch_rad in -0.6..0.6, angle in -3.2..3.2f64,
    ) {
        let levelling = Levelling::new(&Attitude { roll_rad, pitch_rad }, HEIGHT_M);
        let (along, normal) =
            (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos()));
        prop_assert!(levelling.rotate(along).dot(&levelling.normal(normal)).abs() < 1e-12);
    }
}

/// A laser between two walls, leaning: on the plan the walls stand where they stand.
#[test]
fn walls_stand_where_they_stand_however_the_laser_leans() {
    let laser = LaserModel::half_circle(181);
    let wall_m = 2.0;
    for (roll_rad, pitch_rad) in [(0.0, -0.17), (0.1, -0.1), (-0.2, 0.0)] {
        let attitude = Attitude { roll_rad, pitch_rad };
        let base = leaning(&attitude);
        let origin = base.transform(Vector3::new(0.0, 0.0, HEIGHT_M));
        let reading = |beam: usize| {
            let angle = laser.bearing(beam);
            let direction = base.rotation * Vector3::new(angle.cos(), angle.sin(), 0.0);
            (((wall_m - origin.y) / direction.y).max((-wall_m - origin.y) / direction.y)) as f32
        };
        let readings: Vec<f32> = (0..181).map(reading).collect();
        let scan = Scan::classify(laser, &readings);
        let levelling = Levelling::new(&attitude, HEIGHT_M);
        let levelled = levelling.scan(&scan, &Pose2::IDENTITY);
        let mounting = levelling.mounting(&Pose2::IDENTITY);
        let mut hits = 0;
        for beam in (0..181).filter(|&beam| levelled.class(beam) == BeamClass::Hit) {
            let (sin, cos) = laser.bearing(beam).sin_cos();
            let at = mounting.transform(Vector2::new(cos, sin) * f64::from(levelled.range(beam)));
            // The beam that points there is at most half a step off.
            let off = (at.y.abs() - wall_m).abs();
            let half_step = 0.5 * laser.angle_increment_rad;
            assert!(off < 1.5 * half_step * (1.0 + at.norm_squared() / wall_m), "{beam}: {off} m");
            hits += 1;
        }
        assert!(hits > 60, "{hits} hits left at {attitude:?}");
    }
}

#[test]
fn a_level_robot_sees_what_it_sees() {
    let laser = LaserModel::half_circle(181);
    let readings: Vec<f32> = (0..181).map(|i| 2.0 + 0.01 * i as f32).collect();
    let scan = Scan::classify(laser, &readings);
    let levelled = Levelling::new(&Attitude::default(), HEIGHT_M).scan(&scan, &Pose2::IDENTITY);
    assert_eq!(levelled, scan);
    assert_eq!(Attitude::default().tilt_rad(), 0.0);
    let tilt = Attitude { roll_rad: 0.3, pitch_rad: -0.2 }.tilt_rad();
    let up = leaning(&Attitude { roll_rad: 0.3, pitch_rad: -0.2 }).rotation * Vector3::z();
    assert!((tilt - up.z.acos()).abs() < 1e-12);
}
