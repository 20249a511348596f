//! Planted wrong closures: graduated non-convexity and the whole robust pipeline.

use crate::walks::{Walk, add};
use geometry::Pose2;
use manifoldslam_optimizer::{
    EdgeKind, GncLoss, GncSettings, Optimizer, RobustSettings, Settings, optimize, optimize_gnc,
    optimize_robust,
};

#[test]
fn gnc_finds_planted_outliers() {
    for loss in [GncLoss::TruncatedLeastSquares, GncLoss::GemanMcClure] {
        let mut walk = Walk::new(200, 21);
        let mut clean = walk.graph.clone();
        optimize(&mut clean, &Settings::default()).unwrap();
        let right = walk.graph.edges().len();
        walk.spoil(walk.closures() / 4, 22);
        let mut graph = walk.graph.clone();
        let settings = GncSettings { loss, ..GncSettings::new(3) };
        let report = optimize_gnc(&mut Optimizer::new(), &mut graph, &settings).unwrap();
        assert!(walk.error(&graph) < 1.1 * walk.error(&clean), "{loss:?}");
        let (inside, outside) = report.weights.split_at(right);
        assert!(outside.iter().all(|weight| *weight < 0.1), "{loss:?}");
        assert!(inside.iter().filter(|weight| **weight < 0.3).count() <= right / 100, "{loss:?}");
    }
}

#[test]
fn the_pipeline_stands_any_share_of_wrong_closures() {
    for seed in 0..4 {
        let mut clean = Walk::new(400, 30 + seed);
        optimize(&mut clean.graph, &Settings::default()).unwrap();
        let best = clean.error(&clean.graph);
        for (share, limit) in [(0, 1.1), (10, 1.2), (30, 1.2), (50, 1.5), (80, 3.0)] {
            let mut walk = Walk::new(400, 30 + seed);
            let right = walk.graph.edges().len();
            walk.spoil(walk.closures() * share / (100 - share), seed);
            let result = optimize_robust(&mut walk.graph, &RobustSettings::new(3)).unwrap();
            let error = walk.error(&walk.graph);
            assert!(error <= limit * best, "seed {seed}, {share} %: {error}, clean {best}");
            let wrong = result.inliers[right..].iter().filter(|inlier| **inlier).count();
            let missed = result.inliers[..right].iter().filter(|inlier| !**inlier).count();
            assert!(wrong <= 2, "seed {seed}, {share} %: {wrong} wrong closures kept");
            assert!(missed <= right / 50, "seed {seed}, {share} %: {missed} right ones refused");
        }
    }
}

#[test]
fn the_start_does_not_matter_and_runs_repeat() {
    let mut walk = Walk::new(250, 41);
    walk.spoil(walk.closures(), 42);
    let (mut first, mut second) = (walk.graph.clone(), walk.graph.clone());
    for id in 1..250 {
        second.set_pose(id, Pose2::new(-(id as f64), 3.0, 1.0)).unwrap();
    }
    let settings = RobustSettings::new(3);
    let one = optimize_robust(&mut first, &settings).unwrap();
    let two = optimize_robust(&mut second, &settings).unwrap();
    assert_eq!(one.inliers, two.inliers);
    assert_eq!(first.nodes(), second.nodes());
}

/// Two robots without a common start: only closures that agree may join them.
#[test]
fn islands_are_joined_by_the_closures_that_agree() {
    let walk = Walk::new(300, 43);
    let mut graph = walk.graph.filtered(|edge| walk.graph.ends()[edge] != [149, 150]);
    let right = graph.edges().len();
    for k in 0..30 {
        let pose = Pose2::new((k as f64).sin(), (2.0 * k as f64).cos(), k as f64);
        add(&mut graph, 5 * k, 299 - 4 * k, pose, EdgeKind::Closure);
    }
    let result = optimize_robust(&mut graph, &RobustSettings::new(3)).unwrap();
    assert!(result.inliers[right..].iter().all(|inlier| !inlier));
    let mut clean = walk.graph.clone();
    optimize(&mut clean, &Settings::default()).unwrap();
    assert!(walk.error(&graph) < 1.5 * walk.error(&clean) + 0.05, "{}", walk.error(&graph));
}
