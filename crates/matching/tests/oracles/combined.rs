//! The combined matcher: found from far, honest about look-alikes, one answer for a reference that
//! is prepared once or every time.

use crate::rooms::{cloud, pair};
use geometry::{Matrix3, Pose2, Vector3};
use manifoldslam_matching::protocol::{perturbations, pose_error};
use manifoldslam_matching::{
    CombinedMatcher, MatchStatus, Matcher, PointCloud, Prior, SearchWindow,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::f64::consts::PI;
use synthetic::{FloorPlan, LaserNoise, RayCaster, Scanner, Situation, office_plan};

fn scanner() -> Scanner {
    Scanner::half_circle(361, LaserNoise::gaussian(0.01))
}

/// A scan, and a reference made of scans to four sides around it, in the `world` frame.
fn seen_around(world: &RayCaster, at: &Pose2, rng: &mut StdRng) -> (PointCloud, PointCloud) {
    let mut reference = PointCloud::default();
    for quarter in 0..4 {
        let pose = Pose2::new(at.x + 0.2, at.y - 0.1, 0.5 * PI * f64::from(quarter));
        let scan = cloud(&scanner().scan(world, &pose, rng));
        reference.extend(&scan.transformed(&pose));
    }
    (reference, cloud(&scanner().scan(world, at, rng)))
}

#[test]
fn thirty_degrees_and_half_a_metre_are_found_without_a_prior() {
    let matcher = CombinedMatcher::default();
    for seed in 0..20 {
        let pair = pair(seed, 0.4, 10.0);
        let (reference, scan) = (cloud(&pair.reference), cloud(&pair.scan));
        let direction = 0.7 * seed as f64;
        let side = if seed % 2 == 0 { 0.52 } else { -0.52 };
        let off = Pose2::new(0.5 * direction.cos(), 0.5 * direction.sin(), side);
        let truth = pair.truth();
        let found = matcher.align(&reference, &scan, &Prior::guess(truth * off));
        assert!(found.status.is_usable(), "seed {seed}: {:?}", found.status);
        assert!(found.pose.distance(&truth) < 0.02, "seed {seed}: {:?} {truth:?}", found.pose);
    }
}

/// What is known for certain is not searched for: far from the truth the answer stays near a firm
/// guess, and is not called good.
#[test]
fn a_firm_guess_is_not_left() {
    let pair = pair(3, 0.3, 10.0);
    let (reference, scan) = (cloud(&pair.reference), cloud(&pair.scan));
    let guess = pair.truth() * Pose2::new(0.7, 0.4, 0.9);
    let firm = Matrix3::from_diagonal(&Vector3::new(1e12, 1e12, 1e12));
    let found = CombinedMatcher::default().align(
        &reference,
        &scan,
        &Prior { pose: guess, information: firm },
    );
    assert!(!found.status.is_usable() || found.pose.distance(&guess) < 1e-3, "{found:?}");
}

/// A bare oblong room looks the same from the other side.
#[test]
fn a_room_with_two_ways_round_is_ambiguous() {
    let mut plan = FloorPlan::new();
    plan.rectangle((-4.0, -2.5), (4.0, 2.5));
    let bare = RayCaster::new(plan.clone());
    plan.block((2.0, 1.5), (1.0, 0.8), 0.2);
    let furnished = RayCaster::new(plan);
    let matcher = CombinedMatcher::default();
    for seed in 0..10 {
        let rng = &mut StdRng::seed_from_u64(seed);
        let at = Pose2::new(
            rng.random_range(-1.5..1.0),
            rng.random_range(-1.0..1.0),
            rng.random_range(-PI..PI),
        );
        let window = SearchWindow {
            centre: Pose2::IDENTITY,
            half_x_m: 3.0,
            half_y_m: 2.0,
            half_yaw_rad: PI,
        };
        let mut status = |world: &RayCaster| {
            let (reference, scan) = seen_around(world, &at, rng);
            let prepared = matcher.prepare(&reference, window.half_x_m);
            let found = prepared.search(&scan, &window, &Prior::guess(Pose2::IDENTITY));
            (found.status, found.pose.distance(&at))
        };
        let (bare, _) = status(&bare);
        assert!(matches!(bare, MatchStatus::Ambiguous { .. }), "seed {seed}: {bare:?}");
        let (furnished, off) = status(&furnished);
        // The block is behind the robot now and then: then the two ways round are alike again.
        let ambiguous = matches!(furnished, MatchStatus::Ambiguous { .. });
        assert!(ambiguous || off < 0.05, "seed {seed}: {furnished:?} {off}");
    }
}

/// Anywhere in an office of look-alike rooms: the place, or "ambiguous"; never another place.
#[test]
fn a_building_is_never_mistaken() {
    let world = RayCaster::new(office_plan(5, 2));
    let rng = &mut StdRng::seed_from_u64(9);
    let (low, high) = world.plan().bounds();
    let mut map = PointCloud::default();
    let free = |rng: &mut StdRng| loop {
        let (x, y) = (rng.random_range(low.x..high.x), rng.random_range(low.y..high.y));
        if world.plan().clearance(geometry::Vector2::new(x, y)) > 0.4 {
            return Pose2::new(x, y, rng.random_range(-PI..PI));
        }
    };
    let places: Vec<Pose2> = (0..24).map(|_| free(rng)).collect();
    for place in &places {
        let (reference, _) = seen_around(&world, place, rng);
        map.extend(&reference);
    }
    let middle = 0.5 * (low + high);
    let window = SearchWindow {
        centre: Pose2::new(middle.x, middle.y, 0.0),
        half_x_m: 0.5 * (high.x - low.x),
        half_y_m: 0.5 * (high.y - low.y),
        half_yaw_rad: PI,
    };
    let matcher = CombinedMatcher::default();
    let prepared = matcher.prepare(&map, window.half_x_m.max(window.half_y_m));
    let mut right = 0;
    for place in &places {
        let scan = cloud(&scanner().scan(&world, place, rng));
        let found = prepared.search(&scan, &window, &Prior::guess(Pose2::IDENTITY));
        let near = found.pose.distance(place) < 0.1;
        assert!(near || !found.status.is_usable(), "{place:?}: {found:?}");
        right += usize::from(near && found.status.is_usable());
    }
    assert!(right >= 8, "{right} of 24 told apart");
}

/// The thesis's places at other noises than its own: found from everywhere, or said not to be.
#[test]
fn the_thesis_s_places_are_found_at_any_noise() {
    let matcher = CombinedMatcher::default();
    for noise in [0.005, 0.01, 0.02, 0.03] {
        for situation in Situation::ALL {
            let world = RayCaster::new(situation.plan());
            let noise = LaserNoise { max_range: 20.0, ..LaserNoise::gaussian(noise) };
            let pair = situation.pair(&world, &Situation::scanner(noise), 11);
            let (reference, scan) = (cloud(&pair.reference), cloud(&pair.scan));
            for guess in perturbations().iter().step_by(6) {
                let start = guess.disturb(&pair.truth());
                let found = matcher.align(&reference, &scan, &Prior::guess(start));
                let error = pose_error(&found.pose, &pair.truth());
                assert!(error < 0.1, "{situation:?} {noise:?} {guess:?}: {error} {found:?}");
            }
        }
    }
}
