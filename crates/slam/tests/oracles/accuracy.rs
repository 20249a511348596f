//! Maps against the truth of the building they show.

use crate::runs::{ate, building, map, mapped_building};
use geometry::Pose2;
use manifold::Provenance;
use manifoldslam_slam::{OdometrySettings, RefitMethod, RefitSettings, SlamConfig};

fn with_refit(method: RefitMethod) -> SlamConfig {
    SlamConfig { refit: RefitSettings { method, ..Default::default() }, ..Default::default() }
}

#[test]
fn two_loops_are_mapped_within_three_centimetres() {
    let (run, mapped) = (building(), mapped_building());
    let odometry: Vec<Pose2> = run.observations.iter().filter_map(|o| o.odom_from_base).collect();
    let (error, drift) = (ate(&run.truth, &mapped.trajectory), ate(&run.truth, &odometry));
    println!("ATE {error:.4} m, odometry alone {drift:.2} m; {:?}", mapped.statistics);
    assert!(drift > 0.5, "the log is too good to show anything");
    assert!(error < 0.03, "{error}");
    assert_eq!(mapped.statistics.scans, run.observations.len());
    assert_eq!(mapped.manifold.islands().len(), 1);
}

/// Closures may only be as wrong as the noise lets them.
#[test]
fn closures_are_found_and_true() {
    let (run, mapped) = (building(), mapped_building());
    let truth_of = |patch: manifold::PatchId| {
        let stamp = mapped.manifold.patch(patch).stamp;
        let index = run.observations.iter().position(|o| o.stamp == stamp);
        run.truth[index.expect("patches are scans of the log")]
    };
    let closures: Vec<_> = mapped
        .manifold
        .active_relations()
        .filter(|r| r.provenance == Provenance::LoopClosure)
        .collect();
    println!("{} closures", closures.len());
    assert!(closures.len() >= 3);
    for closure in closures {
        let truth = truth_of(closure.from).between(&truth_of(closure.to));
        let error = closure.from_from_to.mean.between(&truth);
        assert!(error.norm() < 0.15 && error.yaw.abs() < 0.03, "{closure:?}: off by {error:?}");
    }
}

#[test]
fn scan_matching_alone_still_closes_the_loops() {
    let odometry = OdometrySettings { enabled: false, ..Default::default() };
    let config = SlamConfig { odometry, ..Default::default() };
    let run = building();
    let mapped = map(config, &run.observations);
    let error = ate(&run.truth, &mapped.trajectory);
    println!("ATE {error:.4} m without odometry; {:?}", mapped.statistics);
    assert!(error < 0.1, "{error}");
}

#[test]
fn every_refit_runs_and_the_global_one_is_the_best() {
    let run = building();
    let error = |method| ate(&run.truth, &map(with_refit(method), &run.observations).trajectory);
    let global = ate(&run.truth, &mapped_building().trajectory);
    let [breadth_first, relations] = [RefitMethod::BreadthFirst, RefitMethod::Relations].map(error);
    println!("ATE {global:.4} global, {breadth_first:.4} breadth first, {relations:.4} relations");
    assert!(global <= relations && global <= breadth_first);
    assert!(breadth_first < 0.3 && relations < 0.1);
}

/// The map of a robot with perfect wheels and laser is the building, to the matcher's resolution.
#[test]
fn the_error_shrinks_with_the_noise() {
    use synthetic::{LaserNoise, Robot, Scanner, WheelNoise, two_loop_building_with};
    let scanner = Scanner::half_circle(181, LaserNoise { max_range: 40.0, ..LaserNoise::NONE });
    let robot = Robot { scanner, wheels: WheelNoise::NONE, ..Robot::default() };
    let run = two_loop_building_with(1, &robot);
    let perfect = ate(&run.truth, &map(SlamConfig::default(), &run.observations).trajectory);
    let noisy = ate(&building().truth, &mapped_building().trajectory);
    println!("ATE {perfect:.4} m without noise, {noisy:.4} m with");
    assert!(perfect < noisy && perfect < 0.015, "{perfect} {noisy}");
}
