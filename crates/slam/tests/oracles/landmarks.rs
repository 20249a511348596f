//! Landmarks and meetings: islands join by them alone, loops close by them, and wrong ids are
//! refused.

use crate::runs::{Mapped, ate, building, map};
use geometry::{Matrix2, Pose2, Vector2};
use manifold::{PatchId, Provenance};
use manifoldslam_slam::{
    IslandLandmark, IslandLandmarks, LandmarkSettings, MergeState, RefitMethod, SlamConfig, Team,
    compare_landmarks,
};
use proptest::prelude::*;
use sensing::{LandmarkKind, RobotId};
use synthetic::{
    Landmark, LandmarkSensor, RayCaster, Robot, Run, WheelNoise, office_plan, ring_corridor,
};

/// Landmarks alone: no place is compared with another island's.
fn by_landmarks() -> SlamConfig {
    let mut config = SlamConfig::default();
    config.merging.geometry = false;
    config
}

fn tag(id: Option<&str>, x: f64, y: f64) -> Landmark {
    Landmark { kind: LandmarkKind::Tag, id: id.map(Into::into), position: Vector2::new(x, y) }
}

/// A part of a run as a run, its odometry in a frame of its own.
fn part(run: &Run, scans: std::ops::Range<usize>, odom: Pose2) -> Run {
    let mut observations = run.observations[scans.clone()].to_vec();
    for observation in &mut observations {
        observation.odom_from_base = observation.odom_from_base.map(|pose| odom * pose);
    }
    Run { plan: run.plan.clone(), truth: run.truth[scans].to_vec(), observations }
}

/// The two-loop building's run cut in two that share the way from scan 280 to 400.
fn halves() -> [Run; 2] {
    let run = building();
    let odom = Pose2::new(-40.0, 17.0, 2.0);
    [part(run, 0..400, Pose2::IDENTITY), part(run, 280..run.truth.len(), odom)]
}

/// Landmarks half a metre beside the shared way, where a robot looked.
fn beside_the_way(ids: &[Option<&str>]) -> Vec<Landmark> {
    let along = |i: usize| building().truth[290 + i * 100 / ids.len().max(2)];
    let place = |i: usize| {
        along(i).transform(Vector2::new(1.5, if i.is_multiple_of(2) { 0.5 } else { -0.5 }))
    };
    ids.iter().enumerate().map(|(i, id)| tag(*id, place(i).x, place(i).y)).collect()
}

fn team_of(runs: &[Run], config: SlamConfig) -> Team {
    let mut team = Team::new(config);
    for (number, run) in runs.iter().enumerate() {
        team.map_robot(&format!("robot-{number}"), run.observations.iter().cloned());
    }
    team.finish();
    team
}

/// The two halves with landmarks that each robot reads in its own way.
fn team_that_saw(first: &[Landmark], second: &[Landmark]) -> Team {
    let mut runs = halves();
    let sensor = LandmarkSensor::default();
    sensor.see(&mut runs[0], first, 1);
    sensor.see(&mut runs[1], second, 2);
    team_of(&runs, by_landmarks())
}

/// Error of all robots' trajectories in one frame, metres.
fn error_m(team: &Team, runs: &[Run]) -> f64 {
    let truth: Vec<Pose2> = runs.iter().flat_map(|run| run.truth.clone()).collect();
    let estimate: Vec<Pose2> =
        (0..runs.len()).flat_map(|k| team.trajectory(RobotId(k as u16))).collect();
    ate(&truth, &estimate)
}

fn count(team: &Team, provenance: Provenance) -> usize {
    team.manifold().active_relations().filter(|r| r.provenance == provenance).count()
}

#[test]
fn robots_that_saw_the_same_three_tags_become_one_map() {
    let tags = beside_the_way(&[Some("a"), Some("b"), Some("c")]);
    let team = team_that_saw(&tags, &tags);
    assert_eq!(team.manifold().islands().len(), 1, "{:?}", team.merges());
    assert_eq!(team.merges()[0].provenance, Provenance::Landmark);
    assert_eq!(
        (count(&team, Provenance::Landmark) > 0, count(&team, Provenance::Merge)),
        (true, 0)
    );
    let error = error_m(&team, &halves());
    assert!(error < 0.05, "{error} m");
    let landmarks = team.landmarks();
    let both = vec![RobotId(0), RobotId(1)];
    let known: Vec<_> = landmarks.iter().map(|l| (l.id.as_deref(), l.robots.clone())).collect();
    assert_eq!(known, ["a", "b", "c"].map(|id| (Some(id), both.clone())));
    // Between the tags the distances are the true ones.
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let found = (landmarks[i].in_island() - landmarks[j].in_island()).norm();
        let truth = (tags[i].position - tags[j].position).norm();
        assert!((found - truth).abs() < 0.1, "{found} m for {truth} m");
    }
}

#[test]
fn what_one_robot_reads_wrong_is_refused() {
    let ids = [Some("a"), Some("b"), Some("c"), Some("d"), Some("e")];
    let tags = beside_the_way(&ids);
    let mut read = tags.clone();
    read[1].id = Some("e".into());
    let team = team_that_saw(&tags, &read);
    assert_eq!(team.manifold().islands().len(), 1, "{:?}", team.merges());
    let error = error_m(&team, &halves());
    assert!(error < 0.05, "{error} m");
    // The place that one calls "e" and the other "b" is both.
    let at = |id: &str| team.landmarks().iter().filter(|l| l.id.as_deref() == Some(id)).count();
    assert_eq!((at("a"), at("b"), at("e")), (1, 1, 2));
}

#[test]
fn ids_that_all_mean_something_else_join_nothing() {
    let tags = beside_the_way(&[Some("a"), Some("b"), Some("c"), Some("d"), Some("e")]);
    let other = beside_the_way(&[Some("c"), Some("e"), Some("b"), Some("a"), Some("d")]);
    let team = team_that_saw(&tags, &other);
    assert_eq!(team.manifold().islands().len(), 2, "{:?}", team.merges());
    assert!(team.merges().iter().all(|m| m.state == MergeState::Provisional));
}

#[test]
fn a_pattern_of_landmarks_without_ids_joins_too() {
    let tags = beside_the_way(&[None; 7]);
    let team = team_that_saw(&tags, &tags);
    assert_eq!(team.manifold().islands().len(), 1, "{:?}", team.merges());
    let error = error_m(&team, &halves());
    assert!(error < 0.05, "{error} m");
}

/// The two halves with everything that joins them.
fn team_that_saw_and_compared(first: &[Landmark], second: &[Landmark]) -> Team {
    let mut runs = halves();
    let sensor = LandmarkSensor::default();
    sensor.see(&mut runs[0], first, 1);
    sensor.see(&mut runs[1], second, 2);
    team_of(&runs, SlamConfig::default())
}

#[test]
fn what_walls_and_landmarks_say_alike_is_one_merge_and_surer() {
    let tags = beside_the_way(&[Some("a"), Some("b"), Some("c")]);
    let alone = team_that_saw_and_compared(&[], &[]);
    let both = team_that_saw_and_compared(&tags, &tags);
    let [[alone], [merge]] = [alone.merges(), both.merges()] else { panic!("{:?}", both.merges()) };
    assert!(merge.false_bound < alone.false_bound);
    assert!(merge.evidence.agreeing > alone.evidence.agreeing);
    assert!(count(&both, Provenance::Merge) > 0 && count(&both, Provenance::Landmark) > 0);
    let error = error_m(&both, &halves());
    assert!(error < 0.05, "{error} m");
}

#[test]
fn tags_that_were_all_moved_do_not_outvote_the_walls() {
    let tags = beside_the_way(&[Some("a"), Some("b"), Some("c"), Some("d")]);
    // What hung together was carried elsewhere together, between the two drives.
    let carried = Pose2::new(3.0, -1.0, 0.1);
    let moved: Vec<_> = tags
        .iter()
        .map(|t| Landmark { position: carried.transform(t.position), ..t.clone() })
        .collect();
    let team = team_that_saw_and_compared(&tags, &moved);
    let error = error_m(&team, &halves());
    assert!(team.manifold().islands().len() == 2 || error < 0.05, "{error} m, {:?}", team.merges());
}

#[test]
fn a_merge_by_landmarks_is_taken_back_without_a_trace() {
    let tags = beside_the_way(&[Some("a"), Some("b"), Some("c")]);
    let mut team = team_that_saw(&tags, &tags);
    assert!(!team.split(RobotId(1)).is_empty());
    team.finish();
    assert_eq!(team.manifold().islands().len(), 2);
    let mut without = team.with_relations(|r| r.is_active());
    without.rebuild();
    assert_eq!(team.manifold().patches(), without.manifold().patches());
}

/// Two robots in an office at the same time: they drive along the same corridor towards each other.
fn robots_that_meet() -> [Run; 2] {
    let world = RayCaster::new(office_plan(4, 2));
    let robot = Robot::default();
    let west = [(1.0, 25.0), (1.0, 13.0), (1.0, 1.0), (14.0, 1.0)];
    let east = [(29.0, 25.0), (29.0, 13.0), (29.0, 1.0), (18.0, 1.0)];
    let mut runs =
        [Run::record_in(&world, &robot, &west, 1), Run::record_in(&world, &robot, &east, 2)];
    let sensor =
        LandmarkSensor { range_m: 10.0, yaw_std_rad: Some(0.05), ..LandmarkSensor::default() };
    sensor.see_each_other(&mut runs, &["robot-0", "robot-1"], 3);
    runs
}

#[test]
fn robots_that_see_each_other_become_one_map() {
    let runs = robots_that_meet();
    let seen = |run: &Run| run.observations.iter().map(|o| o.sightings.len()).sum::<usize>();
    assert!(seen(&runs[0]) > 0 && seen(&runs[1]) > 0, "they meet");
    let team = team_of(&runs, by_landmarks());
    assert_eq!(team.manifold().islands().len(), 1, "{:?}", team.merges());
    assert_eq!(team.merges()[0].provenance, Provenance::Rendezvous);
    assert!(count(&team, Provenance::Rendezvous) > 0);
    let error = error_m(&team, &runs);
    assert!(error < 0.1, "{error} m");
    assert!(team.landmarks().is_empty(), "a robot does not stand still");
    let mut config = by_landmarks();
    config.merging.landmarks.common_clock = false;
    assert_eq!(team_of(&runs, config).manifold().islands().len(), 2);
}

/// A ring of corridor driven once round and on, with landmarks where the robot looks at these
/// scans.
fn ring(landmarks: &[(usize, Option<&str>)]) -> Run {
    let robot = Robot { wheels: WheelNoise::poor(), ..Robot::default() };
    let mut run = ring_corridor(3, 160.0, 20.0, 12.0, &robot);
    let place = |k: usize| run.truth[k].transform(Vector2::new(2.0, 0.4));
    let tags: Vec<_> =
        landmarks.iter().map(|&(k, id)| (place(k), id)).map(|(p, id)| tag(id, p.x, p.y)).collect();
    LandmarkSensor::default().see(&mut run, &tags, 1);
    run
}

/// Closing loops by landmarks or not at all, and no refit that hides the difference.
fn closing_by_landmarks(enabled: bool) -> SlamConfig {
    let mut config = SlamConfig::default();
    config.closing.enabled = false;
    config.refit.method = RefitMethod::Relations;
    config.merging.landmarks.enabled = enabled;
    config
}

fn closures(mapped: &Mapped) -> usize {
    let relations = mapped.manifold.active_relations();
    relations.filter(|r| r.provenance == Provenance::Landmark).count()
}

#[test]
fn a_loop_closes_where_a_landmark_is_seen_again() {
    let named = [(10, Some("a")), (30, Some("b")), (50, Some("c"))];
    // One without an id may be any of its kind: it closes the loop where there is no other.
    for landmarks in [&named[..], &[(30, None)]] {
        let run = ring(landmarks);
        let closed = map(closing_by_landmarks(true), &run.observations);
        let open = map(closing_by_landmarks(false), &run.observations);
        let [with, without] = [&closed, &open].map(|m| ate(&run.truth, &m.trajectory));
        assert!(closures(&closed) > 0 && closures(&open) == 0, "{landmarks:?} {with} {without}");
        assert!(with < 0.5 * without, "{landmarks:?}: {with} m, {without} m without landmarks");
    }
}

#[test]
fn a_tag_that_hangs_at_two_places_closes_no_loop() {
    let run = ring(&[(10, Some("a")), (200, Some("a")), (400, Some("a"))]);
    let mapped = map(closing_by_landmarks(true), &run.observations[..run.truth.len() - 120]);
    assert_eq!(closures(&mapped), 0);
}

/// Landmarks of one island, each seen from the island's first patch.
fn island(places: &[(Option<String>, Vector2<f64>)]) -> IslandLandmarks {
    let landmarks: Vec<IslandLandmark> = places
        .iter()
        .map(|(id, place)| IslandLandmark {
            kind: LandmarkKind::Tag,
            id: id.as_deref().map(Into::into),
            patch: PatchId(0),
            island_from_patch: Pose2::IDENTITY,
            position: *place,
            covariance: Matrix2::identity() * 1e-4,
            yaw: None,
            sightings: 1,
            robots: vec![RobotId(0)],
        })
        .collect();
    let drift = vec![Matrix2::zeros(); landmarks.len() * landmarks.len()];
    IslandLandmarks { landmarks, drift, area_m2: 900.0 }
}

proptest! {
    /// The closed form finds the alignment however the islands lie, and whatever one id says.
    #[test]
    fn the_alignment_is_found_and_one_wrong_id_refused(
        places in prop::collection::vec((0.0..30.0f64, 0.0..30.0f64), 4..9),
        x in -50.0..50.0f64, y in -50.0..50.0f64, yaw in -3.0..3.0f64, wrong in 0..9usize,
    ) {
        let places: Vec<Vector2<f64>> = places.iter().map(|p| Vector2::new(p.0, p.1)).collect();
        let far_apart = |i: usize| (0..i).all(|j| (places[i] - places[j]).norm() > 4.0);
        prop_assume!((0..places.len()).all(far_apart));
        let truth = Pose2::new(x, y, yaw);
        let named: Vec<_> =
            places.iter().enumerate().map(|(i, p)| (Some(i.to_string()), *p)).collect();
        let wrong = wrong % places.len();
        let mut moved: Vec<_> =
            named.iter().map(|(id, p)| (id.clone(), truth.inverse().transform(*p))).collect();
        moved[wrong].1 += Vector2::new(3.0, 0.0);
        let found = compare_landmarks(&island(&named), &island(&moved), &LandmarkSettings::default());
        let found = found.unwrap();
        prop_assert!(found.target_from_source.mean.distance(&truth) < 1e-6);
        prop_assert!(found.target_from_source.mean.between(&truth).yaw.abs() < 1e-6);
        prop_assert_eq!(found.refused, 1);
        prop_assert!(found.pairs.iter().all(|&(t, s)| t == s && t != wrong));
    }

    /// Two ids agree, the third was read wrong: that it hangs where the others say makes up for its
    /// id. Where it hangs elsewhere, it says nothing.
    #[test]
    fn a_tag_read_wrong_counts_where_it_hangs(
        x in -50.0..50.0f64, y in -50.0..50.0f64, yaw in -3.0..3.0f64, taken in any::<bool>(),
    ) {
        let corners = [(0.0, 0.0), (8.0, 1.0), (5.0, 7.0)].map(|(x, y)| Vector2::new(x, y));
        let truth = Pose2::new(x, y, yaw);
        let named = |ids: [&str; 3], places: [Vector2<f64>; 3]| {
            let landmark = |(id, p): (&str, Vector2<f64>)| (Some(id.to_owned()), p);
            island(&ids.into_iter().zip(places).map(landmark).collect::<Vec<_>>())
        };
        let target = named(["a", "b", "c"], corners);
        let mut seen = corners.map(|p| truth.inverse().transform(p));
        let read = ["a", "b", if taken { "a" } else { "d" }];
        let settings = LandmarkSettings { false_merges: 1e-3, ..LandmarkSettings::default() };
        let found = compare_landmarks(&target, &named(read, seen), &settings).unwrap();
        prop_assert!(found.target_from_source.mean.distance(&truth) < 1e-6);
        prop_assert!(found.false_bound < settings.false_merges && found.pairs.len() == 3, "{found:?}");
        seen[2] += Vector2::new(1.0, 2.0);
        let found = compare_landmarks(&target, &named(read, seen), &settings).unwrap();
        prop_assert!(found.false_bound > settings.false_merges, "{found:?}");
        prop_assert_eq!(found.pairs.len(), 2);
    }

    /// Two tags that could as well be two others say nothing.
    #[test]
    fn an_ambiguous_alignment_is_never_sure(x in 2.0..20.0f64, y in 2.0..20.0f64) {
        let (a, b) = (Some("a".to_owned()), Some("b".to_owned()));
        let corners = |id: &Option<String>, shift: f64| (id.clone(), Vector2::new(shift, shift * y / x));
        let target = island(&[corners(&a, 0.0), corners(&b, x), corners(&b, -x)]);
        let source = island(&[corners(&a, 0.0), corners(&b, x)]);
        let found = compare_landmarks(&target, &source, &LandmarkSettings::default()).unwrap();
        prop_assert_eq!(found.false_bound, 1.0);
    }
}
