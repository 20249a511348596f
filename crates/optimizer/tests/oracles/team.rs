//! Two robots that do not know each other's frame, and closures between them that may be false.

use crate::walks::{Graph2, Walk, add, noise};
use geometry::Pose2;
use logs::g2o::{Graph, open_g2o};
use manifoldslam_optimizer::{
    Edge, EdgeKind, RobustSettings, Settings, find_joints, optimize, optimize_robust,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::path::PathBuf;

/// Nodes of both robots, half each.
const NODES: usize = 300;

/// A walk cut in two: the halves know nothing of each other but the closures.
fn halves(seed: u64) -> Walk {
    let mut walk = Walk::new(NODES, seed);
    let cut = [NODES as u32 / 2 - 1, NODES as u32 / 2];
    walk.graph = walk.graph.filtered(|edge| walk.graph.ends()[edge] != cut);
    walk
}

fn across(ends: &[u32; 2]) -> bool {
    (ends[0] < NODES as u32 / 2) != (ends[1] < NODES as u32 / 2)
}

/// Closures between the halves, `groups` groups of eight: one random place is taken for another.
fn add_aliases(walk: &mut Walk, groups: usize, rng: &mut StdRng) {
    for _ in 0..groups {
        let a = rng.random_range(0..NODES / 2 - 10);
        let b = rng.random_range(NODES / 2..NODES - 10);
        let claimed = Pose2::new(
            rng.random_range(-2.0..2.0),
            rng.random_range(-2.0..2.0),
            rng.random_range(-3.0..3.0),
        );
        for _ in 0..8 {
            let (from, to) = (a + rng.random_range(0..10), b + rng.random_range(0..10));
            let start = walk.truth[from].between(&walk.truth[a]);
            let end = walk.truth[b].between(&walk.truth[to]);
            let pose = start * claimed * end * noise(rng);
            add(&mut walk.graph, from, to, pose, EdgeKind::Closure);
        }
    }
}

#[test]
fn aliased_places_do_not_join_robots() {
    // Three times as many right closures as there are in a group of wrong ones.
    let met = |seed: &u64| {
        let walk = halves(*seed);
        walk.graph.ends().iter().filter(|ends| across(ends)).count() >= 24
    };
    for seed in (60..).filter(met).take(6) {
        let mut clean = halves(seed);
        optimize(&mut clean.graph, &Settings::default()).unwrap();
        let mut walk = halves(seed);
        let right = walk.graph.edges().len();
        add_aliases(&mut walk, 12, &mut StdRng::seed_from_u64(seed));
        let joints = find_joints(&walk.graph, |_| true);
        assert_eq!(joints[0].trees, [0, NODES as u32 / 2]);
        assert!(joints[0].rival >= 3 && joints[0].members.len() > joints[0].rival, "seed {seed}");
        let result = optimize_robust(&mut walk.graph, &RobustSettings::new(3)).unwrap();
        let wrong = result.inliers[right..].iter().filter(|inlier| **inlier).count();
        let missed = result.inliers[..right].iter().filter(|inlier| !**inlier).count();
        assert!(
            wrong == 0 && missed <= 2,
            "seed {seed}: kept {wrong} wrong, missed {missed} right"
        );
        let (error, best) = (walk.error(&walk.graph), clean.error(&clean.graph));
        assert!(error <= 1.2 * best + 0.01, "seed {seed}: {error}, clean {best}");
    }
}

/// Where only wrong closures remain, and two groups of the same size, the robots stay apart.
#[test]
fn equal_claims_join_nothing() {
    let mut walk = halves(70);
    walk.graph = walk.graph.filtered(|edge| !across(&walk.graph.ends()[edge]));
    let own = walk.graph.edges().len();
    let mut rng = StdRng::seed_from_u64(71);
    for (a, b, yaw) in [(20_usize, 170_usize, 0.3), (90, 260, -2.0)] {
        for k in 0..6 {
            let start = walk.truth[a + k].between(&walk.truth[a]);
            let end = walk.truth[b].between(&walk.truth[b + k]);
            let pose = start * Pose2::new(1.0, -0.5, yaw) * end * noise(&mut rng);
            add(&mut walk.graph, a + k, b + k, pose, EdgeKind::Closure);
        }
    }
    let result = optimize_robust(&mut walk.graph, &RobustSettings::new(3)).unwrap();
    assert!(result.inliers[own..].iter().all(|inlier| !inlier));
}

/// Two robots of csail.g2o, with 250 random closures among 128 right ones.
#[test]
fn published_robots_are_joined() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/pose-graphs/csail-two-robots");
    if !folder.exists() {
        println!("skipped: {} is missing", folder.display());
        return;
    }
    let read = |name: &str| match open_g2o(&folder.join(name)).unwrap().graph {
        Graph::Plane(graph) => graph,
        Graph::Space(_) => panic!("a plane"),
    };
    let mut clean = read("CSAIL.g2o");
    optimize(&mut clean, &Settings::default()).unwrap();
    let mut graph = Graph2::new();
    for robot in ["CSAIL_robot1.g2o", "CSAIL_robot2.g2o"].map(read) {
        for node in robot.nodes() {
            graph.add_node(node.id, node.pose).unwrap();
        }
        for edge in robot.edges() {
            graph.add_edge(*edge).unwrap();
        }
    }
    let right = read("CSAIL_interrobot_loop_closures.g2o");
    let own = graph.edges().len();
    for edge in read("CSAIL_interrobot_loop_closures_outliers.g2o").edges() {
        graph.add_edge(Edge { kind: EdgeKind::Closure, ..*edge }).unwrap();
    }
    let is_right = |edge: &Edge<Pose2, 3>| {
        right.edges().iter().any(|r| Edge { kind: EdgeKind::Closure, ..*r } == *edge)
    };
    let truth: Vec<bool> = graph.edges()[own..].iter().map(is_right).collect();
    let result = optimize_robust(&mut graph, &RobustSettings::new(3)).unwrap();
    let judged = truth.iter().zip(&result.inliers[own..]);
    let kept = judged.clone().filter(|(right, inlier)| **right && **inlier).count();
    let refused = judged.filter(|(right, inlier)| !**right && !**inlier).count();
    assert!(kept >= 126 && refused >= 248, "kept {kept} of 128, refused {refused} of 250");
    // The first nodes coincide in both.
    let squares = graph.nodes().iter().map(|n| n.pose.distance(clean.pose(n.id).unwrap()).powi(2));
    let distance = (squares.sum::<f64>() / graph.nodes().len() as f64).sqrt();
    assert!(distance < 0.05, "{distance} m from the clean optimum");
}
