//! The optimiser against GTSAM's stored answers (`bench/optimizer/make_fixtures.py`).

use geometry::Pose2;
use logs::g2o::{G2oPose, Graph, read_g2o};
use manifoldslam_optimizer::{Optimizer, PoseGraph, Settings};
use nalgebra::Matrix3;
use std::path::Path;

/// Lines of GTSAM's answer that start with `name`, as numbers.
fn answers(text: &str, name: &str) -> Vec<Vec<f64>> {
    let lines = text.lines().filter(|line| line.starts_with(name));
    lines.map(|line| line.split(' ').filter_map(|field| field.parse().ok()).collect()).collect()
}

fn check<G: G2oPose<D>, const D: usize>(graph: &mut PoseGraph<G, D>, answer: &str) {
    let costs = &answers(answer, "chi2")[0];
    assert!((graph.chi2() / costs[0] - 1.0).abs() < 1e-9, "another definition of the cost");
    let settings = Settings { relative_tolerance: 1e-12, ..Settings::default() };
    Optimizer::new().optimize(graph, &settings).unwrap();
    assert!(graph.chi2() <= costs[1] * (1.0 + 1e-9), "{} GTSAM {}", graph.chi2(), costs[1]);
    for line in answers(answer, "pose") {
        let expected = G::from_numbers(&line[1..]).unwrap();
        let difference = graph.pose(line[0] as u64).unwrap().between(&expected).log().norm();
        assert!(difference < 1e-6, "pose {} differs by {difference}", line[0]);
    }
}

#[test]
fn plane() {
    let text = include_str!("../fixtures/plane.g2o");
    let Graph::Plane(mut graph) = read_g2o(text.as_bytes(), Path::new("plane")).graph else {
        panic!("not a plane")
    };
    let answer = include_str!("../fixtures/plane.gtsam.txt");
    check::<Pose2, 3>(&mut graph, answer);
    let marginals = Optimizer::new().marginals(&graph, &[13, 39]).unwrap();
    for line in answers(answer, "covariance") {
        let expected = Matrix3::from_row_slice(&line[2..]);
        let got = marginals.covariance(line[0] as u64, line[1] as u64).unwrap();
        // GTSAM held the first node by a strong prior, and dropped second-order terms differ.
        assert!((got - expected).norm() < 1e-5 * expected.norm(), "{got} GTSAM {expected}");
    }
}

#[test]
fn space() {
    let text = include_str!("../fixtures/space.g2o");
    let Graph::Space(mut graph) = read_g2o(text.as_bytes(), Path::new("space")).graph else {
        panic!("not in space")
    };
    check(&mut graph, include_str!("../fixtures/space.gtsam.txt"));
}
