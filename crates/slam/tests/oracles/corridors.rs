//! Places that look alike, and places where little is seen: what the map does not know must not be
//! taken for what it does.

use crate::runs::{Mapped, ate, map};
use geometry::Pose2;
use manifold::Provenance;
use manifoldslam_slam::SlamConfig;
use synthetic::{FloorPlan, LaserNoise, Robot, Run, Scanner, WheelNoise, hall, ring_corridor};

fn robot(max_range: f64, wheels: WheelNoise) -> Robot {
    let noise = LaserNoise { max_range, ..LaserNoise::default() };
    Robot { scanner: Scanner::half_circle(181, noise), wheels, ..Robot::default() }
}

/// Closures that hold in the map and are more than `metres` off: `(scan, scan)`.
fn wrong_closures(run: &Run, mapped: &Mapped, metres: f64) -> Vec<(usize, usize)> {
    let scan_of = |patch: manifold::PatchId| {
        let stamp = mapped.manifold.patch(patch).stamp;
        let index = run.observations.iter().position(|o| o.stamp == stamp);
        index.expect("patches are scans of the log")
    };
    let closures = mapped.manifold.active_relations();
    closures
        .filter(|r| r.provenance == Provenance::LoopClosure)
        .filter_map(|r| {
            let (from, to) = (scan_of(r.from), scan_of(r.to));
            let truth = run.truth[from].between(&run.truth[to]);
            let off = r.from_from_to.mean.between(&truth).norm() > metres;
            off.then_some((from, to))
        })
        .collect()
}

/// After a gap the scan may fit the known part of the corridor better than the unknown part it was
/// taken in. (The stress log `gaps`, variant 1, once broke by this.)
#[test]
fn a_gap_in_a_corridor_is_driven_through() {
    const GAP: usize = 20;
    let run = ring_corridor(3, 160.0, 5.0, 4.0, &robot(30.0, WheelNoise::default()));
    for at in [60, 170, 290] {
        let log = [&run.observations[..at], &run.observations[at + GAP..]].concat();
        let truth = [&run.truth[..at], &run.truth[at + GAP..]].concat();
        let missed = run.truth[at - 1].distance(&run.truth[at + GAP]);
        assert!(missed > 3.0, "{missed}");
        let error = ate(&truth, &map(SlamConfig::default(), &log).trajectory);
        println!("gap at {at}: ATE {error:.3} m");
        assert!(error < 0.3, "{at}: {error}");
    }
}

/// A scan of few points fits at many places. (The stress log `hall` once broke by this.)
#[test]
fn a_few_points_do_not_move_the_robot() {
    for seed in [4, 5] {
        let run = hall(seed, 40.0, 30.0, &robot(6.0, WheelNoise::default()));
        let mapped = map(SlamConfig::default(), &run.observations);
        let error = ate(&run.truth, &mapped.trajectory);
        let poor = mapped.statistics.poor_fits;
        println!("hall {seed}: ATE {error:.3} m, {poor} of {} scans fit poorly", run.truth.len());
        assert!(poor > 10, "the hall is too easy: {poor}");
        assert!(error < 1.0, "{seed}: {error}");
        assert_eq!(wrong_closures(&run, &mapped, 0.5), []);
    }
}

/// A square ring of corridor, 240 m around, with a door every `spacing` metres on the outer side.
fn regular_ring(spacing: f64) -> FloorPlan {
    const SIDE: f64 = 60.0;
    let mut plan = FloorPlan::new();
    plan.rectangle((-1.2, -1.2), (SIDE + 1.2, SIDE + 1.2));
    plan.rectangle((1.2, 1.2), (SIDE - 1.2, SIDE - 1.2));
    let doors = ((SIDE - 6.0) / spacing) as usize;
    for along in (0..doors).map(|i| 4.0 + spacing * i as f64) {
        plan.block((along, -1.14), (0.9, 0.12), 0.0);
        plan.block((SIDE + 1.14, along), (0.12, 0.9), 0.0);
        plan.block((SIDE - along, SIDE + 1.14), (0.9, 0.12), 0.0);
        plan.block((-1.14, SIDE - along), (0.12, 0.9), 0.0);
    }
    plan
}

/// Closures in a row may agree about the wrong door. (The stress log `killian`, variant 2, once
/// broke by this.)
#[test]
fn doors_that_look_alike_are_not_confused() {
    for seed in [1, 2] {
        let wheels = WheelNoise { distance_scale: 0.02, ..WheelNoise::default() };
        let way = [(1.5, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0), (0.0, 0.0), (40.0, 0.0)];
        let run = Run::record(regular_ring(5.0), &robot(15.0, wheels), &way, seed);
        let mapped = map(SlamConfig::default(), &run.observations);
        let error = ate(&run.truth, &mapped.trajectory);
        let odometry: Vec<Pose2> =
            run.observations.iter().filter_map(|o| o.odom_from_base).collect();
        let drift = ate(&run.truth, &odometry);
        println!("ring {seed}: ATE {error:.3} m, odometry {drift:.2} m; {:?}", mapped.statistics);
        assert!(drift > 2.0, "odometry is too good to confuse doors: {drift}");
        assert_eq!(wrong_closures(&run, &mapped, 2.0), [], "{seed}");
    }
}
