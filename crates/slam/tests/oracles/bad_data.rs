//! Data that go bad: noticed where it happened and left out; the rest is as good as ever.

use crate::runs::{ate, building, mapped_building};
use geometry::Pose2;
use manifold::{RelationState, Retraction};
use manifoldslam_slam::{BadStretch, Fault, Mapper, SlamConfig, Team};
use sensing::{Attitude, Observation, RobotId};
use synthetic::{Mishap, MishapRun, mishap};

fn mapper(observations: &[Observation]) -> Mapper {
    let mut mapper = Mapper::new(SlamConfig::default());
    for observation in observations {
        mapper.step(observation.clone());
    }
    mapper
}

/// The finished map of one robot, as its own team.
fn team(observations: &[Observation], merging: bool) -> Team {
    let mut config = SlamConfig::default();
    config.merging.enabled = merging;
    let mut team = Team::new(config);
    team.map_robot("robot", observations.iter().cloned());
    team.finish();
    team
}

/// The error of the scans that are not left out, island by island: the largest.
fn error(team: &Team, truth: &[Pose2]) -> f64 {
    let islands = team.manifold().component_map();
    let bad = team.bad_stretches(RobotId(0));
    let mut pairs = vec![(Vec::new(), Vec::new()); islands.members.len()];
    let poses = team.scan_poses(RobotId(0)).zip(team.trajectory(RobotId(0)));
    for (i, (scan, pose)) in poses.enumerate() {
        if bad.iter().all(|stretch| !stretch.scans.contains(&i)) {
            let (true_poses, estimates) = &mut pairs[islands.of(scan.patch)];
            true_poses.push(truth[i]);
            estimates.push(pose);
        }
    }
    pairs
        .iter()
        .map(|(truth, poses)| ate(truth, poses))
        .filter(|e| e.is_finite())
        .fold(0.0, f64::max)
}

fn only(stretches: &[BadStretch]) -> &BadStretch {
    let [stretch] = stretches else { panic!("{stretches:?}") };
    stretch
}

/// The island of every part that is drawn.
fn drawn_islands(team: &Team) -> usize {
    let manifold = team.manifold();
    manifold.islands().iter().filter(|island| !manifold.patch(island[0]).left_out).count()
}

#[test]
fn good_data_are_left_alone() {
    let statistics = mapped_building().statistics;
    assert_eq!(statistics.scans, building().observations.len());
    assert!(mapper(&building().observations).bad_stretches().is_empty());
    assert!(mapped_building().manifold.patches().iter().all(|p| !p.left_out));
}

#[test]
fn a_robot_that_is_carried_goes_on_on_another_island() {
    for seed in [4, 6, 10] {
        let MishapRun { run, bad } = mishap(Mishap::Carried, seed);
        let team = team(&run.observations, false);
        let stretch = only(team.bad_stretches(RobotId(0)));
        assert_eq!((stretch.fault, stretch.scans.start), (Fault::Lost, bad.start), "{seed}");
        assert!(stretch.scans.len() < 10 && !stretch.bridged, "{stretch:?}");
        assert_eq!(drawn_islands(&team), 2);
        let error = error(&team, &run.truth);
        assert!(error < 0.03, "{seed}: {error} m");
    }
}

/// It comes back to where it has been: geometry says how its two pieces lie to each other, and
/// where that alone is not sure enough, the user's word makes them one map.
#[test]
fn the_pieces_of_a_carried_robot_are_joined_by_geometry() {
    let MishapRun { run, .. } = mishap(Mishap::Carried, 2);
    let mut team = team(&run.observations, true);
    only(team.bad_stretches(RobotId(0)));
    let [merge] = team.merges() else { panic!("{:?}", team.merges()) };
    let relation = merge.relations[0];
    team.confirm(relation);
    team.rebuild();
    assert_eq!(drawn_islands(&team), 1, "{:?}", team.merges());
    let error = error(&team, &run.truth);
    assert!(error < 0.03, "{error} m");
}

#[test]
fn a_robot_on_its_back_or_side_is_left_out_from_there_on() {
    for (kind, seeds) in [(Mishap::OnItsBack, [0, 2]), (Mishap::OnItsSide, [2, 3])] {
        for seed in seeds {
            let MishapRun { run, bad } = mishap(kind, seed);
            let team = team(&run.observations, true);
            assert_eq!(only(team.bad_stretches(RobotId(0))).scans, bad, "{kind:?} {seed}");
            assert_eq!(drawn_islands(&team), 1);
            assert!(error(&team, &run.truth) < 0.05);
        }
    }
}

#[test]
fn a_laser_that_is_blind_for_a_while_costs_only_that_while() {
    for kind in [Mishap::Covered, Mishap::Dead] {
        let MishapRun { run, bad } = mishap(kind, 2);
        let team = team(&run.observations, true);
        let stretch = only(team.bad_stretches(RobotId(0)));
        assert_eq!((stretch.fault, stretch.scans.start), (Fault::Blind, bad.start));
        assert!(stretch.bridged && stretch.scans.end - bad.end <= 3, "{stretch:?}");
        assert_eq!(drawn_islands(&team), 1);
        let error = error(&team, &run.truth);
        assert!(error < 0.05, "{kind:?}: {error} m");
    }
}

#[test]
fn without_odometry_blindness_cuts_the_map() {
    let MishapRun { mut run, .. } = mishap(Mishap::Dead, 2);
    run.observations.iter_mut().for_each(|o| o.odom_from_base = None);
    let mapper = mapper(&run.observations);
    let stretches = mapper.bad_stretches();
    assert!(stretches.iter().any(|s| s.fault == Fault::Blind && !s.bridged), "{stretches:?}");
}

/// The building's log with the robot leaning by `roll_rad` over some scans, and level else.
fn leaning(roll_rad: f64, scans: std::ops::Range<usize>) -> Vec<Observation> {
    let mut log = building().observations.clone();
    for (i, observation) in log.iter_mut().enumerate() {
        let roll_rad = if scans.contains(&i) { roll_rad } else { 0.02 };
        observation.attitude = Some(Attitude { roll_rad, pitch_rad: -0.01 });
    }
    log
}

#[test]
fn a_robot_that_says_it_has_tipped_over_is_believed() {
    for roll_rad in [std::f64::consts::PI, -1.5] {
        let stretches = mapper(&leaning(roll_rad, 500..usize::MAX)).bad_stretches();
        let all = building().observations.len();
        assert_eq!((only(&stretches).fault, &only(&stretches).scans), (Fault::Tipped, &(500..all)));
    }
    let up_again = mapper(&leaning(3.0, 400..450));
    let stretch = only(&up_again.bad_stretches()).clone();
    assert_eq!((stretch.scans, stretch.bridged), (400..452, false));
    for fine in [leaning(0.7, 300..500), leaning(3.0, 300..303)] {
        assert!(mapper(&fine).bad_stretches().is_empty(), "a ramp, or a reading that is wrong");
    }
}

#[test]
fn what_is_left_out_is_taken_back_for_that_reason_and_leaves_no_trace() {
    let MishapRun { run, .. } = mishap(Mishap::Carried, 6);
    let team = team(&run.observations, false);
    let manifold = team.manifold();
    let out = |patch| manifold.patch(patch).left_out;
    let bad = RelationState::Retracted(Retraction::BadData);
    assert!(manifold.relations().iter().any(|r| r.state == bad));
    for relation in manifold.active_relations() {
        assert_eq!(out(relation.from), out(relation.to), "{relation:?}");
    }
    let mut without = team.with_relations(|r| r.is_active());
    without.rebuild();
    assert_eq!(manifold.patches(), without.manifold().patches());
    assert_eq!(team.trajectory(RobotId(0)), without.trajectory(RobotId(0)));
}

/// A short piece at the end of the log is left out; where the log goes on it is taken in again.
#[test]
fn a_piece_is_left_out_until_it_has_proven_itself() {
    let MishapRun { run, bad } = mishap(Mishap::Carried, 6);
    let (begin, rest) = run.observations.split_at(bad.start + 12);
    let mut mapper = mapper(begin);
    mapper.finish();
    assert_eq!(only(&mapper.bad_stretches()).scans, bad.start..begin.len());
    for observation in rest {
        mapper.step(observation.clone());
    }
    mapper.finish();
    assert_eq!(only(&mapper.bad_stretches()).scans.len(), 6);
    let left_out = mapper.manifold().patches().iter().filter(|p| p.left_out).count();
    assert!((1..=6).contains(&left_out), "{left_out}");
}

#[test]
fn who_does_not_want_to_be_watched_is_not() {
    let MishapRun { run, .. } = mishap(Mishap::OnItsSide, 2);
    let mut config = SlamConfig::default();
    config.integrity.enabled = false;
    let mut mapper = Mapper::new(config);
    for observation in run.observations {
        mapper.step(observation);
    }
    mapper.finish();
    assert!(mapper.bad_stretches().is_empty());
    assert!(mapper.manifold().patches().iter().all(|p| !p.left_out));
}
