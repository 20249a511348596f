//! Laws that every matcher obeys whatever the data, and the cases where a match must be refused.

use crate::rooms::{cloud, pair};
use geometry::{LieGroup, Matrix3, Pose2, Vector2, Vector3};
use manifoldslam_matching::{
    CloudPoint, MatchStatus, Matcher, NeighbourTree, PointCloud, Prior, WsmMatcher, WsmSettings,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use synthetic::{FloorPlan, LaserNoise, RayCaster, Scanner, corridor};

fn matchers() -> Vec<Box<dyn Matcher>> {
    manifoldslam_matching::MATCHER_NAMES
        .iter()
        .map(|name| manifoldslam_matching::matcher(name).expect("a registered name"))
        .collect()
}

fn near(a: &Pose2, b: &Pose2, metres: f64, radians: f64) -> bool {
    let delta = a.between(b).log();
    delta.xy().norm() < metres && delta.z.abs() < radians
}

#[test]
fn tree_equals_brute_force() {
    let mut rng = StdRng::seed_from_u64(2);
    for n in [0, 1, 7, 9, 100, 1777] {
        let mut coordinate = |scale: f64| (rng.random_range(-scale..scale) * 8.0).round() / 8.0;
        // Coordinates on a coarse grid, so that equal distances and equal points occur.
        let points: Vec<_> =
            (0..n).map(|_| Vector2::new(coordinate(9.0), coordinate(4.0))).collect();
        let tree = NeighbourTree::new(points.iter().copied());
        for _ in 0..500 {
            let query = Vector2::new(coordinate(12.0), coordinate(6.0));
            let gate = coordinate(4.0).abs();
            let brute = points
                .iter()
                .enumerate()
                .map(|(i, p)| ((p - query).norm_squared(), i))
                .filter(|(d2, _)| *d2 <= gate * gate)
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let found = tree.nearest(query, gate * gate).map(|(i, d2)| (d2, i));
            assert_eq!(found, brute);
            let mut within = Vec::new();
            tree.within(query, gate * gate, |i| within.push(i));
            within.sort_unstable();
            let near = |i: &usize| (points[*i] - query).norm_squared() <= gate * gate;
            assert_eq!(within, (0..n).filter(near).collect::<Vec<_>>());
        }
    }
}

#[test]
fn identical_scans_are_at_the_identity() {
    for matcher in matchers() {
        // Surfels are averages over 10 cm, voxels over half a metre, not the points themselves.
        let (metres, radians) = match matcher.name() {
            "fast" | "combined" => (2e-3, 4e-4),
            "ndt" | "ndt-d2d" => (2e-3, 5e-4),
            "vgicp" => (4e-3, 1.5e-3),
            _ => (2e-4, 1e-4),
        };
        for seed in 0..5 {
            let scan = cloud(&pair(seed, 0.3, 10.0).scan);
            let result = matcher.align(&scan, &scan, &Prior::guess(Pose2::new(0.05, -0.04, 0.03)));
            assert_eq!(result.status, MatchStatus::Converged, "{} {seed}", matcher.name());
            assert!(
                near(&result.pose, &Pose2::IDENTITY, metres, radians),
                "{} {seed}: {:?}",
                matcher.name(),
                result.pose
            );
        }
    }
}

#[test]
fn moving_both_clouds_moves_the_answer() {
    let reference_motion = Pose2::new(3.0, -1.0, 0.4);
    let scan_motion = Pose2::new(-0.5, 2.0, -0.8);
    for matcher in matchers() {
        // Pairs at a gate may fall either way, and cells and voxels lie differently.
        let (metres, radians) = match matcher.name() {
            "fast" | "combined" | "ndt" | "ndt-d2d" => (6e-3, 2e-3),
            "vgicp" => (8e-3, 2e-3),
            // Its metric turns about the scan's origin, which is moved here as well.
            "mbicp" => (5e-3, 1.5e-3),
            _ => (1e-3, 2e-4),
        };
        for seed in 0..8 {
            let pair = pair(seed, 0.25, 8.0);
            let (a, b) = (cloud(&pair.reference), cloud(&pair.scan));
            let guess = Pose2::IDENTITY;
            let plain = matcher.align(&a, &b, &Prior::guess(guess));
            let moved_guess = reference_motion * guess * scan_motion.inverse();
            let moved = matcher.align(
                &a.transformed(&reference_motion),
                &b.transformed(&scan_motion),
                &Prior::guess(moved_guess),
            );
            let expected = reference_motion * plain.pose * scan_motion.inverse();
            assert!(
                near(&moved.pose, &expected, metres, radians),
                "{} {seed}: {:?} {expected:?}",
                matcher.name(),
                moved.pose
            );
        }
    }
}

#[test]
fn forward_and_inverse_agree_within_their_covariance() {
    for matcher in matchers() {
        for seed in 20..40 {
            let pair = pair(seed, 0.25, 8.0);
            let (a, b) = (cloud(&pair.reference), cloud(&pair.scan));
            let forward = matcher.align(&a, &b, &Prior::guess(Pose2::IDENTITY));
            let backward = matcher.align(&b, &a, &Prior::guess(Pose2::IDENTITY));
            let loop_error = (forward.pose * backward.pose).log();
            let sigma = forward.covariance.diagonal().map(f64::sqrt);
            for axis in 0..3 {
                assert!(
                    loop_error[axis].abs() < 4.0 * sigma[axis] + 1e-3,
                    "{} {seed}: {loop_error:?} with {sigma:?}",
                    matcher.name()
                );
            }
        }
    }
}

#[test]
fn truth_is_found_from_afar() {
    for matcher in matchers() {
        let right = (200..240)
            .filter(|&seed| {
                let pair = pair(seed, 0.3, 10.0);
                let result = matcher.align(
                    &cloud(&pair.reference),
                    &cloud(&pair.scan),
                    &Prior::guess(Pose2::IDENTITY),
                );
                result.status.is_usable() && near(&result.pose, &pair.truth(), 0.02, 0.005)
            })
            .count();
        println!("{}: {right} of 40", matcher.name());
        assert!(right >= 38, "{}: {right} of 40", matcher.name());
    }
}

#[test]
fn a_corridor_leaves_its_axis_open() {
    let world = RayCaster::new(corridor(60.0, 2.0));
    let noise = LaserNoise { max_range: 8.0, ..LaserNoise::gaussian(0.01) };
    let scanner = Scanner::half_circle(361, noise);
    let mut rng = StdRng::seed_from_u64(3);
    for yaw in [0.0, 0.3, 1.2] {
        let a = cloud(&scanner.scan(&world, &Pose2::new(0.0, 0.1, yaw), &mut rng));
        let b = cloud(&scanner.scan(&world, &Pose2::new(0.05, 0.15, yaw + 0.02), &mut rng));
        for name in ["icp", "idc", "mbicp", "wsm", "plicp", "gicp", "vgicp"] {
            let matcher = manifoldslam_matching::matcher(name).expect("a registered name");
            let result = matcher.align(&a, &b, &Prior::guess(Pose2::IDENTITY));
            let MatchStatus::Degenerate { weak_axis } = result.status else {
                panic!("{name}, yaw {yaw}: {:?} {}", result.status, result.covariance);
            };
            let corridor_axis = Vector3::new((yaw + 0.02).cos(), -(yaw + 0.02).sin(), 0.0);
            let off = weak_axis.dot(&corridor_axis).abs();
            assert!(off > 0.99, "{name}, yaw {yaw}: {weak_axis:?}");
            let along = corridor_axis.dot(&(result.covariance * corridor_axis)).sqrt();
            let across = Vector3::new(-corridor_axis.y, corridor_axis.x, 0.0);
            let across = across.dot(&(result.covariance * across)).sqrt();
            let open = across < 0.05 && along > 0.05 && along > 10.0 * across;
            assert!(open, "{name}, yaw {yaw}: {along} {across}");
        }
    }
}

#[test]
fn a_round_room_leaves_the_yaw_open() {
    let mut plan = FloorPlan::new();
    let corner = |i: i32| {
        let angle = f64::from(i) * std::f64::consts::TAU / 720.0;
        (4.0 * angle.cos(), 4.0 * angle.sin())
    };
    for i in 0..720 {
        plan.wall(corner(i), corner(i + 1));
    }
    let world = RayCaster::new(plan);
    let mut scanner = Scanner::half_circle(721, LaserNoise::gaussian(0.01));
    scanner.laser.angle_min_rad = -std::f64::consts::PI;
    scanner.laser.angle_increment_rad = std::f64::consts::TAU / 721.0;
    let mut rng = StdRng::seed_from_u64(4);
    let a = cloud(&scanner.scan(&world, &Pose2::IDENTITY, &mut rng));
    let b = cloud(&scanner.scan(&world, &Pose2::new(0.0, 0.0, 0.1), &mut rng));
    let result = WsmMatcher::default().align(&a, &b, &Prior::guess(Pose2::IDENTITY));
    let MatchStatus::Degenerate { weak_axis } = result.status else {
        panic!("{:?}", result.status);
    };
    assert!(weak_axis.z.abs() > 0.9, "{weak_axis:?}");
}

#[test]
fn a_prior_holds_what_the_scan_leaves_open_and_stays_out_of_the_covariance() {
    let world = RayCaster::new(corridor(60.0, 2.0));
    let noise = LaserNoise { max_range: 8.0, ..LaserNoise::gaussian(0.01) };
    let scanner = Scanner::half_circle(361, noise);
    let mut rng = StdRng::seed_from_u64(5);
    let a = cloud(&scanner.scan(&world, &Pose2::new(0.0, 0.1, 0.0), &mut rng));
    let b = cloud(&scanner.scan(&world, &Pose2::new(0.3, 0.1, 0.0), &mut rng));
    let truth = Pose2::new(0.3, 0.0, 0.0);
    let start = Pose2::new(0.3, 0.05, 0.02);
    let strong =
        Prior { pose: start, information: Matrix3::from_diagonal(&Vector3::new(1e7, 1.0, 1.0)) };
    let held = WsmMatcher::default().align(&a, &b, &strong);
    assert!(held.status.is_usable() && near(&held.pose, &truth, 0.01, 0.003), "{:?}", held.pose);
    assert!((held.pose.x - 0.3).abs() < 3e-3);
    assert!(held.covariance[(0, 0)].sqrt() > 1e-2, "the prior's information is in the covariance");
    let stubborn = Prior { pose: start, information: Matrix3::identity() * 1e12 };
    let kept = WsmMatcher::default().align(&a, &b, &stubborn);
    assert!(near(&kept.pose, &start, 1e-3, 1e-3), "{:?}", kept.pose);
}

#[test]
fn every_matcher_stays_where_a_firm_prior_holds_it() {
    let pair = pair(3, 0.2, 5.0);
    let (a, b) = (cloud(&pair.reference), cloud(&pair.scan));
    let start = pair.truth() * Pose2::new(0.05, -0.04, 0.02);
    for matcher in matchers() {
        let name = matcher.name();
        let firm = Prior { pose: start, information: Matrix3::identity() * 1e12 };
        let held = matcher.align(&a, &b, &firm);
        let free = matcher.align(&a, &b, &Prior::guess(start));
        assert!(near(&held.pose, &start, 1e-6, 1e-6), "{name}: {:?}", held.pose);
        assert!(near(&free.pose, &pair.truth(), 0.02, 0.005), "{name}: {:?}", free.pose);
    }
}

#[test]
fn nothing_to_match_is_said_so() {
    let full = cloud(&pair(1, 0.3, 10.0).scan);
    let few = PointCloud { points: full.points[..3].to_vec() };
    let empty = PointCloud::default();
    let far = full.transformed(&Pose2::new(500.0, 0.0, 0.0));
    for matcher in matchers() {
        for (a, b) in [(&empty, &full), (&full, &empty), (&few, &full), (&empty, &empty)] {
            let result = matcher.align(a, b, &Prior::guess(Pose2::IDENTITY));
            assert!(!result.status.is_usable(), "{}: {:?}", matcher.name(), result.status);
        }
        let result = matcher.align(&full, &few, &Prior::guess(Pose2::IDENTITY));
        assert_eq!(result.status, MatchStatus::TooFewPoints, "{}", matcher.name());
        let result = matcher.align(&far, &full, &Prior::guess(Pose2::IDENTITY));
        assert!(!result.status.is_usable(), "{}: {:?}", matcher.name(), result.status);
    }
}

#[test]
fn garbage_never_panics_nor_gives_nan() {
    let mut rng = StdRng::seed_from_u64(11);
    let mut garbage = |n: usize| {
        let mut number = |scale: f64| match rng.random_range(0..40) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => 0.0,
            3 => rng.random_range(-1e300..1e300),
            _ => rng.random_range(-scale..scale),
        };
        let points = (0..n)
            .map(|i| CloudPoint {
                position: Vector2::new(number(5.0), number(5.0)),
                ray: Vector2::new(number(1.0), number(1.0)),
                range: number(10.0),
                normal: Some(Vector2::new(number(1.0), number(1.0))),
                normal_variance: number(1.0),
                line_distance: number(1.0),
                beam_step: number(0.1),
                beam: (i as u32).wrapping_mul(if n.is_multiple_of(2) { 1 } else { 0x9999_9999 }),
            })
            .collect();
        PointCloud { points }
    };
    for round in 0..60 {
        let (a, b) = (garbage(10 + 7 * round), garbage(300 - 4 * round));
        let information = if round % 3 == 0 { Matrix3::identity() * 1e3 } else { Matrix3::zeros() };
        for matcher in matchers() {
            let result = matcher.align(&a, &b, &Prior { pose: Pose2::IDENTITY, information });
            let name = matcher.name();
            assert!(LieGroup::is_finite(&result.pose), "{name} {round}: {:?}", result.pose);
            assert!(result.covariance.iter().all(|v| v.is_finite()), "{name} {round}");
            assert!((0.0..=1.0).contains(&result.inlier_ratio), "{name} {round}");
        }
    }
}

#[test]
fn settings_refuse_unknown_keys_and_presets_have_names() {
    assert_eq!(WsmSettings::preset("default"), Some(WsmSettings::default()));
    assert_eq!(WsmSettings::preset("thesis"), Some(WsmSettings::thesis()));
    assert_eq!(WsmSettings::preset("?"), None);
    assert!(manifoldslam_matching::matcher("?").is_none());
    for name in manifoldslam_matching::MATCHER_NAMES {
        // "wsm-thesis" is "wsm" with other settings.
        let own = manifoldslam_matching::matcher(name).expect("a registered name").name();
        assert!(own == name || name == "wsm-thesis", "{own} {name}");
    }
}
