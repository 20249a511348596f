//! The solver against dense algebra, against itself, and on graphs that are hard to solve.

use crate::walks::{Graph2, Walk, add, information};
use geometry::{LieGroup, Matrix3, Pose2, Pose3};
use manifoldslam_optimizer::{
    Edge, EdgeKind, Kernel, Method, Optimizer, OptimizerError, PoseGraph, RobustScope, Settings,
    Status, initialize_chordal, initialize_spanning_tree, optimize,
};
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};

/// At the optimum no free node can be moved to lower the cost.
fn assert_stationary<G: LieGroup<D>, const D: usize>(graph: &PoseGraph<G, D>, held: u64) {
    let cost = graph.chi2();
    for node in graph.nodes().iter().filter(|node| node.id != held) {
        for k in 0..D {
            let mut moved = graph.clone();
            let mut slope = 0.0;
            for sign in [-1.0, 1.0] {
                let mut tangent = SVector::<f64, D>::zeros();
                tangent[k] = sign * 1e-5;
                moved.set_pose(node.id, node.pose.retract(&tangent)).unwrap();
                slope += sign * (moved.chi2() - cost) / 2e-5;
            }
            assert!(slope.abs() < 1e-2, "node {} axis {k} slope {slope}", node.id);
        }
    }
}

const TIGHT: Settings = Settings {
    method: Method::LevenbergMarquardt,
    max_iterations: 100,
    relative_tolerance: 1e-14,
    absolute_tolerance: 1e-14,
    kernel: Kernel::Quadratic,
    scope: RobustScope::Closures,
};

#[test]
fn the_optimum_is_stationary_in_the_plane() {
    let mut walk = Walk::new(120, 1);
    let report = optimize(&mut walk.graph, &TIGHT).unwrap();
    assert!(report.final_cost < 0.1 * report.initial_cost);
    assert!((report.final_cost - walk.graph.chi2()).abs() < 1e-9 * report.final_cost);
    assert_stationary(&walk.graph, 0);
}

#[test]
fn the_optimum_is_stationary_in_space() {
    let mut graph = PoseGraph::<Pose3, 6>::new();
    let step = |k: u64| Pose3::exp(&SVector::from([1.0, 0.1, 0.0, 0.05 * k as f64, -0.1, 0.6]));
    let mut pose = Pose3::identity();
    for id in 0..20 {
        graph.add_node(id, pose).unwrap();
        pose = pose * step(id % 3);
    }
    let information = SMatrix::<f64, 6, 6>::from_diagonal_element(100.0);
    for (from, to) in (0..19).map(|k| (k, k + 1)).chain([(0, 12), (5, 17), (19, 2)]) {
        let bent = Pose3::exp(&SVector::from([0.02, 0.0, -0.03, 0.01, 0.04, -0.02]));
        let measured = graph.pose(from).unwrap().between(graph.pose(to).unwrap()) * bent;
        graph.add_edge(Edge::new(from, to, measured, information, EdgeKind::Closure)).unwrap();
    }
    optimize(&mut graph, &TIGHT).unwrap();
    assert_stationary(&graph, 0);
}

/// One undamped step equals that of the dense normal equations with numeric Jacobians.
#[test]
fn a_step_equals_dense_gauss_newton() {
    let walk = Walk::new(60, 3);
    let n = walk.graph.nodes().len() - 1;
    let rows = 3 * walk.graph.edges().len();
    let root = information().cholesky().unwrap().l().transpose();
    let residuals = |graph: &Graph2| {
        let whitened = graph.edges().iter().flat_map(|edge| {
            let [a, b] = [edge.from, edge.to].map(|id| *graph.pose(id).unwrap());
            let residual: Vector3<f64> = root * edge.residual(&a.between(&b));
            [residual.x, residual.y, residual.z]
        });
        DMatrix::from_iterator(rows, 1, whitened)
    };
    let moved = |id: usize, tangent: Vector3<f64>| {
        let mut graph = walk.graph.clone();
        graph.set_pose(id as u64, graph.nodes()[id].pose.retract(&tangent)).unwrap();
        residuals(&graph)
    };
    let mut jacobian = DMatrix::zeros(rows, 3 * n);
    for column in 0..3 * n {
        let mut tangent = Vector3::zeros();
        tangent[column % 3] = 1e-6;
        let slope = (moved(1 + column / 3, tangent) - moved(1 + column / 3, -tangent)) / 2e-6;
        jacobian.set_column(column, &slope.column(0));
    }
    let normal = jacobian.transpose() * &jacobian;
    let step = normal.cholesky().unwrap().solve(&(-jacobian.transpose() * residuals(&walk.graph)));
    let mut graph = walk.graph.clone();
    let once = Settings { max_iterations: 1, method: Method::GaussNewton, ..TIGHT };
    optimize(&mut graph, &once).unwrap();
    for id in 1..=n {
        let tangent = Vector3::new(step[3 * id - 3], step[3 * id - 2], step[3 * id - 1]);
        let expected = walk.graph.nodes()[id].pose.retract(&tangent);
        assert!(expected.between(&graph.nodes()[id].pose).log().norm() < 1e-5, "node {id}");
    }
}

#[test]
fn a_known_structure_gives_the_same_bits() {
    let walk = Walk::new(200, 4);
    let mut optimizer = Optimizer::new();
    let (mut first, mut second) = (walk.graph.clone(), walk.graph.clone());
    let cold = optimizer.optimize(&mut first, &Settings::default()).unwrap();
    let warm = optimizer.optimize(&mut second, &Settings::default()).unwrap();
    assert!(cold.analysed && !warm.analysed);
    assert_eq!(first.nodes(), second.nodes());
    second.set_fixed(7, true).unwrap();
    assert!(optimizer.optimize(&mut second, &Settings::default()).unwrap().analysed);
}

#[test]
fn remeasuring_needs_no_new_analysis_and_counts() {
    let mut walk = Walk::new(100, 5);
    let mut optimizer = Optimizer::new();
    optimizer.optimize(&mut walk.graph, &TIGHT).unwrap();
    let measured = walk.graph.edges()[50].from_from_to * Pose2::new(0.3, 0.0, 0.0);
    walk.graph.remeasure(50, measured, information() * 2.0).unwrap();
    let report = optimizer.optimize(&mut walk.graph, &TIGHT).unwrap();
    assert!(!report.analysed);
    assert_stationary(&walk.graph, 0);
}

#[test]
fn every_component_is_anchored_and_fixed_nodes_stay() {
    let mut graph = Graph2::new();
    for id in 0..9 {
        graph.add_node(id, Pose2::new(id as f64, 0.3 * id as f64, 0.1)).unwrap();
    }
    let one = Pose2::new(1.0, 0.0, 0.0);
    for (from, to) in [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (6, 7)] {
        add(&mut graph, from, to, one, EdgeKind::Closure);
    }
    graph.set_fixed(4, true).unwrap();
    let before = graph.clone();
    let report = optimize(&mut graph, &Settings::default()).unwrap();
    assert_eq!(report.status, Status::Converged);
    for held in [0, 4, 6, 8] {
        assert_eq!(graph.pose(held), before.pose(held), "node {held}");
    }
    for free in [1, 2, 3, 5, 7] {
        assert_ne!(graph.pose(free), before.pose(free), "node {free}");
    }
}

#[test]
fn the_cost_never_rises_and_poses_stay_finite() {
    for seed in 0..10 {
        let mut walk = Walk::new(80, seed);
        walk.spoil(60, seed);
        // Far from any optimum, and with directions that nothing constrains.
        for id in 0..80 {
            let angle = 2.4 * (id * id) as f64;
            walk.graph
                .set_pose(id, Pose2::new(50.0 * angle.sin(), 1e4 * angle.cos(), angle))
                .unwrap();
        }
        let weak = Matrix3::from_diagonal(&Vector3::new(1e12, 0.0, 0.0));
        for edge in (0..walk.graph.edges().len()).step_by(2) {
            let pose = walk.graph.edges()[edge].from_from_to;
            walk.graph.remeasure(edge, pose, weak).unwrap();
        }
        for method in [Method::GaussNewton, Method::LevenbergMarquardt] {
            let mut graph = walk.graph.clone();
            let settings = Settings { method, max_iterations: 30, ..Settings::default() };
            let report = optimize(&mut graph, &settings).unwrap();
            assert!(report.final_cost <= report.initial_cost, "{report:?}");
            assert!(graph.nodes().iter().all(|node| node.pose.is_finite()));
            assert!((graph.chi2() / report.final_cost - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn robust_kernels_resist_a_wrong_closure() {
    let clean = Walk::new(150, 6);
    let mut best = clean.graph.clone();
    optimize(&mut best, &Settings::default()).unwrap();
    let mut spoilt = clean.graph.clone();
    add(&mut spoilt, 10, 140, Pose2::new(8.0, -3.0, 1.0), EdgeKind::Closure);
    let error = |kernel| {
        let mut graph = spoilt.clone();
        graph.clone_from(&spoilt);
        for (node, pose) in best.nodes().iter().map(|node| (node.id, node.pose)) {
            graph.set_pose(node, pose).unwrap();
        }
        let report = optimize(&mut graph, &Settings { kernel, ..Settings::default() }).unwrap();
        (clean.error(&graph), report.weights[spoilt.edges().len() - 1])
    };
    let (plain, _) = error(Kernel::Quadratic);
    for kernel in [
        Kernel::Cauchy { scale: 8.0 },
        Kernel::Dcs { scale: 8.0 },
        Kernel::GemanMcClure { scale: 8.0 },
        Kernel::Truncated { scale: 20.0 },
    ] {
        let (robust, weight) = error(kernel);
        assert!(robust < 1.2 * clean.error(&best) && plain > 2.0 * robust, "{kernel:?} {robust}");
        assert!(weight < 0.1, "{kernel:?} weighs the wrong closure {weight}");
    }
    assert!(error(Kernel::Huber { scale: 8.0 }).0 < 0.7 * plain);
}

#[test]
fn the_spanning_tree_is_the_odometry() {
    let walk = Walk::new(90, 7);
    let mut graph = walk.graph.clone();
    for id in 1..90 {
        graph.set_pose(id, Pose2::IDENTITY).unwrap();
    }
    initialize_spanning_tree(&mut graph, |_| false);
    assert_eq!(graph.nodes(), walk.graph.nodes());
}

#[test]
fn chordal_initialisation_needs_no_start() {
    let mut walk = Walk::new(300, 8);
    let mut best = walk.graph.clone();
    optimize(&mut best, &TIGHT).unwrap();
    for id in 1..300 {
        let angle = 2.4 * (id * id) as f64;
        walk.graph.set_pose(id, Pose2::new(9.0 * angle.sin(), angle, angle)).unwrap();
    }
    walk.graph.set_fixed(0, true).unwrap();
    initialize_chordal(&mut walk.graph).unwrap();
    assert!(walk.graph.chi2() < 3.0 * best.chi2(), "{} {}", walk.graph.chi2(), best.chi2());
    let report = optimize(&mut walk.graph, &TIGHT).unwrap();
    assert!((report.final_cost / best.chi2() - 1.0).abs() < 1e-9);
    // Without noise the answer is exact, in one step and for every component.
    let mut exact = Graph2::new();
    for id in 0..60 {
        exact.add_node(id, walk.truth[id as usize]).unwrap();
    }
    for (a, b) in (0..59).map(|k| (k, k + 1)).chain([(3, 17), (40, 55)]).filter(|e| e.0 != 29) {
        let measured = walk.truth[a].between(&walk.truth[b]);
        add(&mut exact, a, b, measured, EdgeKind::Sequential);
    }
    initialize_chordal(&mut exact).unwrap();
    for id in 0..60 {
        let difference = walk.truth[id].between(&exact.nodes()[id].pose).log().norm();
        assert!(difference < 1e-9, "node {id}: {difference}");
    }
}

#[test]
fn the_door_refuses_what_cannot_be_used() {
    let mut graph = Graph2::new();
    graph.add_node(1, Pose2::IDENTITY).unwrap();
    graph.add_node(2, Pose2::IDENTITY).unwrap();
    let nan = Pose2 { x: f64::NAN, ..Pose2::IDENTITY };
    assert_eq!(graph.add_node(1, Pose2::IDENTITY), Err(OptimizerError::DuplicateNode { id: 1 }));
    assert_eq!(graph.add_node(3, nan), Err(OptimizerError::PoseNotFinite { id: 3 }));
    let edge =
        |from, to, pose, information| Edge::new(from, to, pose, information, EdgeKind::Closure);
    let one = Matrix3::identity();
    let wrong = [
        (edge(1, 9, Pose2::IDENTITY, one), OptimizerError::UnknownNode { id: 9 }),
        (edge(1, 1, Pose2::IDENTITY, one), OptimizerError::SelfEdge { id: 1 }),
        (edge(1, 2, nan, one), OptimizerError::MeasurementNotFinite { from: 1, to: 2 }),
        (edge(1, 2, Pose2::IDENTITY, -one), OptimizerError::BadInformation { from: 1, to: 2 }),
        (
            edge(1, 2, Pose2::IDENTITY, one * f64::NAN),
            OptimizerError::BadInformation { from: 1, to: 2 },
        ),
    ];
    for (edge, error) in wrong {
        assert_eq!(graph.add_edge(edge), Err(error));
    }
    assert!(graph.edges().is_empty());
    let mut empty = Graph2::new();
    assert_eq!(optimize(&mut empty, &Settings::default()).unwrap().status, Status::Converged);
}
