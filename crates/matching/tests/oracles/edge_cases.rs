//! What every matcher makes of the cases at the edge: nothing, one point, one line, another order,
//! numbers that are none.

use crate::rooms::{cloud, pair, scanner};
use geometry::{LieGroup, Pose2, Vector3};
use manifoldslam_matching::{
    MATCHER_NAMES, MatchStatus, Matcher, NeighbourTree, PointCloud, PointCloudSettings, Prior,
    matcher,
};
use rand::{SeedableRng, rngs::StdRng, seq::SliceRandom};
use sensing::Scan;
use synthetic::{FloorPlan, RayCaster};

fn matchers() -> impl Iterator<Item = (&'static str, Box<dyn Matcher>)> {
    MATCHER_NAMES.into_iter().map(|name| (name, matcher(name).expect("a registered name")))
}

fn distance(a: &Pose2, b: &Pose2) -> f64 {
    let delta = a.between(b).log();
    delta.xy().norm().hypot(3.0 * delta.z)
}

#[test]
fn the_order_of_points_does_not_matter() {
    let mut rng = StdRng::seed_from_u64(21);
    for (name, matcher) in matchers() {
        let mut worst = 0.0f64;
        for seed in 0..6 {
            let pair = pair(seed, 0.25, 8.0);
            let (a, b) = (cloud(&pair.reference), cloud(&pair.scan));
            let plain = matcher.align(&a, &b, &Prior::guess(Pose2::IDENTITY));
            let [mut a, mut b] = [a, b];
            a.points.shuffle(&mut rng);
            b.points.shuffle(&mut rng);
            let shuffled = matcher.align(&a, &b, &Prior::guess(Pose2::IDENTITY));
            worst = worst.max(distance(&plain.pose, &shuffled.pose));
        }
        assert!(worst < 1e-9, "{name}: {worst:e}");
    }
}

#[test]
fn the_order_of_a_submap_s_scans_does_not_matter() {
    for (name, matcher) in matchers() {
        let mut worst = 0.0f64;
        for seed in 0..4 {
            let pair = pair(seed, 0.25, 8.0);
            let mut rng = StdRng::seed_from_u64(seed);
            let scans: Vec<PointCloud> = (0..4)
                .map(|k| {
                    let step = Pose2::new(0.1 * f64::from(k), 0.05, 0.05 * f64::from(k));
                    let world_from_base = pair.world_from_reference * step;
                    let scan = scanner().scan(&pair.world, &world_from_base, &mut rng);
                    cloud(&scan).transformed(&step)
                })
                .collect();
            let submap = |order: [usize; 4]| PointCloud {
                points: order.iter().flat_map(|&k| scans[k].points.clone()).collect(),
            };
            let scan = cloud(&pair.scan);
            let [one, other] = [[0, 1, 2, 3], [2, 0, 3, 1]].map(|order| {
                matcher.align(&submap(order), &scan, &Prior::guess(Pose2::IDENTITY)).pose
            });
            worst = worst.max(distance(&one, &other));
        }
        assert!(worst < 1e-9, "{name}: {worst:e}");
    }
}

#[test]
fn one_wall_leaves_its_direction_open() {
    let mut rng = StdRng::seed_from_u64(8);
    let mut plan = FloorPlan::new();
    plan.wall((2.0, -40.0), (2.0, 40.0));
    let world = RayCaster::new(plan);
    let mut scanner = scanner();
    scanner.noise.max_range = 4.0;
    let a = cloud(&scanner.scan(&world, &Pose2::IDENTITY, &mut rng));
    let b = cloud(&scanner.scan(&world, &Pose2::new(0.03, 0.1, 0.02), &mut rng));
    for (name, matcher) in matchers() {
        let result = matcher.align(&a, &b, &Prior::guess(Pose2::IDENTITY));
        let MatchStatus::Degenerate { weak_axis } = result.status else {
            panic!("{name}: {:?}", result.status);
        };
        let along = Vector3::new(0.02f64.sin(), 0.02f64.cos(), 0.0);
        assert!(weak_axis.dot(&along).abs() > 0.999, "{name}: {weak_axis:?}");
        // Across the wall and in turn it is as good as ever.
        let off = (result.pose.x - 0.03).abs().max(2.0 * (result.pose.yaw - 0.02).abs());
        assert!(off < 6e-3, "{name}: {:?}", result.pose);
    }
}

#[test]
fn single_points_and_empty_scans_are_no_match() {
    let full = cloud(&pair(1, 0.3, 10.0).scan);
    let one = PointCloud { points: full.points[100..101].to_vec() };
    let nothing = Scan::classify(scanner().laser, &[f32::INFINITY; 361]);
    let nothing = PointCloud::from_scan(&nothing, &Pose2::IDENTITY, &PointCloudSettings::default());
    assert!(nothing.is_empty());
    for (name, matcher) in matchers() {
        for (a, b) in [(&one, &full), (&full, &one), (&one, &one), (&nothing, &full)] {
            let result = matcher.align(a, b, &Prior::guess(Pose2::IDENTITY));
            assert!(!result.status.is_usable(), "{name}: {:?}", result.status);
            assert!(LieGroup::is_finite(&result.pose), "{name}");
        }
    }
}

#[test]
fn readings_that_are_no_numbers_end_at_the_door() {
    let pair = pair(4, 0.25, 8.0);
    let spoilt = |scan: &Scan| {
        let reading = |i: usize| match i % 12 {
            3 => f32::NAN,
            7 => -1.0,
            11 => [f32::INFINITY, f32::NEG_INFINITY][i / 12 % 2],
            _ => scan.hit(i).unwrap_or(f32::INFINITY),
        };
        cloud(&Scan::classify(*scan.laser(), &(0..scan.len()).map(reading).collect::<Vec<_>>()))
    };
    let (a, b) = (spoilt(&pair.reference), spoilt(&pair.scan));
    for point in a.points.iter().chain(&b.points) {
        assert!(point.position.norm().is_finite() && ![3, 7, 11].contains(&(point.beam % 12)));
    }
    for (name, matcher) in matchers() {
        let result = matcher.align(&a, &b, &Prior::guess(Pose2::IDENTITY));
        let error = distance(&result.pose, &pair.truth());
        assert!(result.status.is_usable() && error < 0.03, "{name}: {error} {:?}", result.status);
    }
}

/// Mean squared distance of the scan's points from the lines of the reference points nearest to
/// them, no more than 10 cm each: no matcher's own objective, and all of theirs agree with it.
fn misfit(tree: &NeighbourTree, reference: &PointCloud, scan: &PointCloud, pose: &Pose2) -> f64 {
    const GATE: f64 = 0.1;
    let squared = |moved| {
        let (index, distance2) = tree.nearest(moved, 0.25)?;
        let nearest = &reference.points[index];
        Some(nearest.normal.map_or(distance2, |n| n.dot(&(moved - nearest.position)).powi(2)))
    };
    let one = |moved| squared(moved).unwrap_or(GATE * GATE).min(GATE * GATE);
    let sum: f64 = scan.points.iter().map(|p| one(pose.transform(p.position))).sum();
    sum / scan.len() as f64
}

#[test]
fn the_misfit_is_least_at_the_result() {
    for (name, matcher) in matchers() {
        for seed in 40..48 {
            let pair = pair(seed, 0.25, 8.0);
            let (a, b) = (cloud(&pair.reference), cloud(&pair.scan));
            let tree = NeighbourTree::new(a.points.iter().map(|p| p.position));
            let start = Pose2::IDENTITY;
            let found = matcher.align(&a, &b, &Prior::guess(start)).pose;
            let here = misfit(&tree, &a, &b, &found);
            assert!(here < 0.5 * misfit(&tree, &a, &b, &start), "{name}, {seed}");
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let mut step = Vector3::zeros();
                    step[axis] = sign * [0.03, 0.03, 0.015][axis];
                    let there = misfit(&tree, &a, &b, &found.retract(&step));
                    assert!(here < there, "{name}, {seed}: {here} {there} {step:?}");
                }
            }
        }
    }
}
