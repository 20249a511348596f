//! Marginal covariances against the inverse of a dense information matrix.

use crate::walks::{Walk, information};
use geometry::{LieGroup, Matrix3, Pose2};
use manifoldslam_optimizer::{Optimizer, Settings, optimize};
use nalgebra::DMatrix;

/// The information matrix of all nodes but the first, with Jacobians of the residual in closed form
/// taken apart from the solver's.
fn dense(graph: &crate::walks::Graph2) -> DMatrix<f64> {
    let n = graph.nodes().len();
    let mut h = DMatrix::zeros(3 * n, 3 * n);
    for (edge, &[a, b]) in graph.edges().iter().zip(graph.ends()) {
        let (a, b) = (a as usize, b as usize);
        let estimated = graph.nodes()[a].pose.between(&graph.nodes()[b].pose);
        let jacobian_to = Pose2::right_jacobian_inverse(&edge.residual(&estimated));
        let jacobian_from = -jacobian_to * estimated.inverse().adjoint();
        for (p, x) in [(a, jacobian_from), (b, jacobian_to)] {
            for (q, y) in [(a, jacobian_from), (b, jacobian_to)] {
                let block = x.transpose() * information() * y;
                let mut view = h.view_mut((3 * p, 3 * q), (3, 3));
                view += block;
            }
        }
    }
    h.view((3, 3), (3 * n - 3, 3 * n - 3)).into_owned()
}

#[test]
fn blocks_equal_those_of_the_dense_inverse() {
    let mut walk = Walk::new(130, 11);
    optimize(&mut walk.graph, &Settings::default()).unwrap();
    let inverse = dense(&walk.graph).try_inverse().unwrap();
    let ids: Vec<u64> = (0..130).rev().step_by(3).chain([0]).collect();
    let marginals = Optimizer::new().marginals(&walk.graph, &ids).unwrap();
    for &a in &ids {
        for &b in &ids {
            let got = marginals.covariance(a, b).unwrap();
            let expected: Matrix3<f64> = if a == 0 || b == 0 {
                Matrix3::zeros()
            } else {
                inverse.fixed_view::<3, 3>(3 * a as usize - 3, 3 * b as usize - 3).into_owned()
            };
            assert!((got - expected).norm() < 1e-9, "{a} {b}: {got} {expected}");
        }
    }
    assert_eq!(marginals.covariance(0, 1), None);
}

/// The covariance of a relative pose does not depend on where the gauge is held.
#[test]
fn relative_covariance_does_not_depend_on_the_anchor() {
    let mut walk = Walk::new(100, 12);
    optimize(&mut walk.graph, &Settings::default()).unwrap();
    let relative = |anchor: u64| {
        let mut graph = walk.graph.clone();
        graph.set_fixed(anchor, true).unwrap();
        let marginals = Optimizer::new().marginals(&graph, &[20, 85]).unwrap();
        marginals.relative(20, 85).unwrap()
    };
    let (first, second) = (relative(0), relative(64));
    assert_eq!(first.mean, second.mean);
    let difference = (first.covariance - second.covariance).norm();
    assert!(difference < 1e-9 * first.covariance.norm(), "{difference}");
    let backwards = {
        let marginals = Optimizer::new().marginals(&walk.graph, &[20, 85]).unwrap();
        marginals.relative(85, 20).unwrap().inverse()
    };
    assert!((first.covariance - backwards.covariance).norm() < 1e-9);
}

/// On a chain, where nothing can be gained from loops, it is the composition of the edges.
#[test]
fn a_chain_has_the_composed_covariance() {
    let walk = Walk::new(30, 13);
    let chain = walk.graph.filtered(|edge| edge < 29);
    let mut expected = chain.edges()[10].gaussian().unwrap();
    for edge in 11..25 {
        expected = expected.compose(&chain.edges()[edge].gaussian().unwrap());
    }
    let got = Optimizer::new().marginals(&chain, &[10, 25]).unwrap().relative(10, 25).unwrap();
    assert!((got.covariance - expected.covariance).norm() < 1e-9 * expected.covariance.norm());
}
