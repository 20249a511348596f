//! Pose graphs: close a loop, ask how well a pose is known, and survive wrong closures.
//!
//! `cargo run --release -p manifoldslam --example 03_optimise_a_pose_graph`

use geometry::{Matrix3, Pose2, Vector3};
use optimizer::{
    Edge, EdgeKind, Optimizer, OptimizerError, PoseGraph, RobustSettings, Settings, Status,
    optimize_robust,
};
use std::f64::consts::FRAC_PI_2;

/// Poses on one side of the square, a metre apart.
const SIDE: u64 = 10;
/// Rounds driven.
const ROUNDS: u64 = 3;

fn main() -> Result<(), OptimizerError> {
    // 1. A robot drives three times around a square of 10 m; odometry turns a little too far and
    //    measures 2 % too short. Poses are `map_from_node`, edges `from_from_to`.
    let truth = drive(1.0, FRAC_PI_2);
    let mut graph = odometry_graph(&drive(0.98, 1.02 * FRAC_PI_2))?;
    println!("by odometry alone: {:.2} m off on average", mean_error(&graph, &truth));

    // 2. Scan matching recognises places of the round before. One call, and the loop closes.
    for from in 0..truth.len() - 4 * SIDE as usize {
        let to = from + 4 * SIDE as usize;
        graph.add_edge(edge(from, to, truth[from].between(&truth[to]), EdgeKind::Closure))?;
    }
    let clean = graph.clone();
    let mut optimizer = Optimizer::new();
    let report = optimizer.optimize(&mut graph, &Settings::default())?;
    let error = mean_error(&graph, &truth);
    println!(
        "optimised: cost {:.0} -> {:.0} in {} iterations, {error:.2} m off",
        report.initial_cost, report.final_cost, report.iterations
    );
    assert_eq!(report.status, Status::Converged);
    assert!(report.final_cost < report.initial_cost && error < 0.5);

    // 3. How well is the far corner known, seen from the start? The factorisation of the last call
    //    serves again; only the columns asked for are solved.
    let corner = 2 * SIDE;
    let marginals = optimizer.marginals(&graph, &[0, corner])?;
    let seen = marginals.relative(0, corner).expect("both were asked for");
    let std = seen.covariance.diagonal().map(f64::sqrt);
    println!("far corner: +-{:.2} m, +-{:.2} m, +-{:.3} rad", std.x, std.y, std.z);
    assert!(std.iter().all(|s| *s > 0.0 && *s < 1.0));

    // 4. Every third closure more is a lie. Plain least squares believes them all; the robust
    //    method finds out which agree with the odometry and with one another.
    let mut doubtful = clean;
    let first_lie = doubtful.edges().len();
    for k in 0..30 {
        let (from, to) = (k * 7 % 50, 60 + k * 11 % 50);
        let lie = Pose2::new((k % 5) as f64 - 2.0, (k % 7) as f64 - 3.0, k as f64);
        doubtful.add_edge(edge(from, to, lie, EdgeKind::Closure))?;
    }
    let mut believing = doubtful.clone();
    optimizer.optimize(&mut believing, &Settings::default())?;
    let found = optimize_robust(&mut doubtful, &RobustSettings::new(3))?;
    let (plain, robust) = (mean_error(&believing, &truth), mean_error(&doubtful, &truth));
    println!("with 30 wrong closures: least squares {plain:.2} m off, robust {robust:.2} m");
    assert!(found.inliers[first_lie..].iter().all(|believed| !believed), "a lie was believed");
    assert!(robust < 1.05 * error && robust < 0.5 * plain);
    Ok(())
}

/// Poses along the square, for steps of one length and corners of one angle.
fn drive(step_m: f64, corner_rad: f64) -> Vec<Pose2> {
    let mut poses = vec![Pose2::IDENTITY];
    for k in 1..=4 * SIDE * ROUNDS {
        let turn = if k % SIDE == 0 { corner_rad } else { 0.0 };
        poses.push(poses[k as usize - 1] * Pose2::new(step_m, 0.0, turn));
    }
    poses
}

fn odometry_graph(poses: &[Pose2]) -> Result<PoseGraph<Pose2, 3>, OptimizerError> {
    let mut graph = PoseGraph::new();
    for (id, pose) in poses.iter().enumerate() {
        graph.add_node(id as u64, *pose)?;
    }
    // The map begins where the robot began.
    graph.set_fixed(0, true)?;
    for (id, pair) in poses.windows(2).enumerate() {
        graph.add_edge(edge(id, id + 1, pair[0].between(&pair[1]), EdgeKind::Sequential))?;
    }
    Ok(graph)
}

/// Standard deviations: 5 cm and 0.02 rad for odometry, 2 cm and 0.01 rad for closures.
fn edge(from: usize, to: usize, measured: Pose2, kind: EdgeKind) -> Edge<Pose2, 3> {
    let (metres, radians): (f64, f64) = match kind {
        EdgeKind::Sequential => (0.05, 0.02),
        EdgeKind::Closure => (0.02, 0.01),
    };
    let information = Vector3::new(metres, metres, radians).map(|std| std.powi(-2));
    Edge::new(from as u64, to as u64, measured, Matrix3::from_diagonal(&information), kind)
}

fn mean_error(graph: &PoseGraph<Pose2, 3>, truth: &[Pose2]) -> f64 {
    let errors = graph.nodes().iter().zip(truth).map(|(node, truth)| node.pose.distance(truth));
    errors.sum::<f64>() / truth.len() as f64
}
