//! Faults of odometry and log in the middle of a run: the map must not break.

use crate::runs::{ate, building, map};
use geometry::Pose2;
use manifoldslam_slam::SlamConfig;
use sensing::Observation;

/// Scans at which the faults are tried: in corridors and rooms, driving straight, turning, in
/// doors.
fn places() -> impl Iterator<Item = usize> {
    (40..=700).step_by(120)
}

/// The log with odometry replaced from scan `from` on: `motion` to the first of them, then on as
/// recorded.
fn odometry_jumps(from: usize, motion: impl Fn(Pose2) -> Pose2) -> Vec<Observation> {
    let mut log = building().observations.clone();
    let recorded: Vec<Pose2> = log.iter().filter_map(|o| o.odom_from_base).collect();
    let first = recorded[from - 1] * motion(recorded[from - 1].between(&recorded[from]));
    for (i, observation) in log.iter_mut().enumerate().skip(from) {
        observation.odom_from_base = Some(first * recorded[from].between(&recorded[i]));
    }
    log
}

fn error_of(name: &str, truth: &[Pose2], log: &[Observation]) -> f64 {
    let error = ate(truth, &map(SlamConfig::default(), log).trajectory);
    println!("{name}: ATE {error:.4} m");
    error
}

/// The errors of the maps of one log per place.
fn errors(name: &str, log_at: impl Fn(usize) -> Vec<Observation>) -> Vec<f64> {
    let truth = &building().truth;
    places().map(|p| error_of(&format!("{name} at {p}"), truth, &log_at(p))).collect()
}

fn below(bound: f64, errors: &[f64]) -> usize {
    errors.iter().filter(|&&e| e < bound).count()
}

#[test]
fn an_odometry_jump_is_seen_through() {
    for turn_deg in [85.0f64, -85.0] {
        let jump = Pose2::new(0.0, 0.0, turn_deg.to_radians());
        let errors =
            errors(&format!("{turn_deg} deg"), |p| odometry_jumps(p, |motion| motion * jump));
        assert_eq!(below(0.03, &errors), errors.len(), "{turn_deg} deg: {errors:?}");
    }
    let errors =
        errors("3.6 m", |p| odometry_jumps(p, |motion| motion * Pose2::new(3.0, -2.0, 0.0)));
    assert_eq!(below(0.03, &errors), errors.len(), "3.6 m: {errors:?}");
}

/// The log with odometry held up for five scans from `place` on.
fn frozen(place: usize) -> Vec<Observation> {
    let mut log = building().observations.clone();
    let held = log[place - 1].odom_from_base;
    for observation in &mut log[place..place + 5] {
        observation.odom_from_base = held;
    }
    log
}

/// Where a corridor hides how far the robot went, frozen wheels say that it stood: the map is then
/// as much too short, and no more.
#[test]
fn frozen_odometry_is_seen_through() {
    let held_up = errors("frozen", frozen);
    assert_eq!(below(0.1, &held_up), held_up.len(), "{held_up:?}");
    let lost = errors("frozen, motion lost", |place| {
        let mut log = frozen(place);
        let recorded = &building().observations;
        let ends = log[place].odom_from_base.zip(recorded[place + 4].odom_from_base);
        let (held, right) = ends.expect("the log has odometry");
        for observation in &mut log[place + 5..] {
            let on = observation.odom_from_base.expect("the log has odometry");
            observation.odom_from_base = Some(held * right.between(&on));
        }
        log
    });
    assert_eq!(below(0.3, &lost), lost.len(), "{lost:?}");
    assert!(below(0.1, &lost) >= 4, "{lost:?}");
}

#[test]
fn odometry_that_comes_and_goes_is_seen_through() {
    let mut log = building().observations.clone();
    for observation in log.iter_mut().skip(100).step_by(2).take(150) {
        observation.odom_from_base = None;
    }
    for observation in &mut log[450..480] {
        observation.odom_from_base = None;
    }
    let error = error_of("odometry now and then", &building().truth, &log);
    assert!(error < 0.03, "{error}");
}

/// Nine scans in a row are missing, three seconds in which the robot turned by about `turn_rad`;
/// with odometry going on meanwhile, or held up as well.
fn gap(turn_rad: f64, held_up: bool) -> f64 {
    const GAP: usize = 9;
    let run = building();
    let turn = |i: usize| run.truth[i].between(&run.truth[i + GAP]).yaw.abs();
    let far = |i: &usize| (turn(*i) - turn_rad).abs();
    let at = (20..run.truth.len() - 20).min_by(|a, b| far(a).total_cmp(&far(b)));
    let at = at.expect("a long run");
    assert!(far(&at) < 0.05);
    let mut log = [&run.observations[..=at], &run.observations[at + GAP..]].concat();
    let truth = [&run.truth[..=at], &run.truth[at + GAP..]].concat();
    let last = log[at].odom_from_base.expect("the log has odometry");
    let next = log[at + 1].odom_from_base.expect("the log has odometry");
    for observation in log.iter_mut().skip(at + 1).filter(|_| held_up) {
        let on = observation.odom_from_base.expect("the log has odometry");
        observation.odom_from_base = Some(last * next.between(&on));
    }
    error_of(&format!("gap at {at}, turned {turn_rad}, held up {held_up}"), &truth, &log)
}

#[test]
fn a_gap_in_which_the_robot_turned_is_bridged() {
    for (turn_rad, held_up) in [(0.8, false), (0.8, true), (1.2, false), (1.6, false), (1.6, true)]
    {
        let error = gap(turn_rad, held_up);
        assert!(error < 0.03, "{turn_rad} {held_up}: {error}");
    }
}

/// Once broke the map: the robot turns in a narrow room while odometry tells it something else.
#[test]
fn false_odometry_in_a_turn_is_seen_through() {
    let truth = &building().truth;
    let jump = Pose2::new(0.0, 0.0, 85f64.to_radians());
    let errors = [
        error_of("frozen at 150", truth, &frozen(150)),
        error_of("85 deg at 150", truth, &odometry_jumps(150, |motion| motion * jump)),
    ];
    assert_eq!(below(0.03, &errors), errors.len(), "{errors:?}");
}
