//! Pairwise consistency maximisation on closures between two robots.

use crate::walks::{Graph2, Walk, add, information, noise};
use geometry::{Gaussian, GaussianPose2, Pose2};
use manifoldslam_optimizer::{
    ClosureCandidate, ConsistencySettings, EdgeKind, Spine, consistent_set, consistent_sets,
};
use rand::{Rng, SeedableRng, rngs::StdRng};

/// The trusted part of a walk: its odometry.
fn spine(walk: &Walk) -> Spine<Pose2, 3> {
    Spine::new(&walk.graph.filtered(|edge| walk.graph.edges()[edge].kind == EdgeKind::Sequential))
}

fn measured(mean: Pose2) -> GaussianPose2 {
    Gaussian { mean, covariance: information().try_inverse().unwrap() }
}

#[test]
fn planted_closures_are_the_largest_set() {
    let walk = Walk::new(120, 51);
    let spine = spine(&walk);
    let mut rng = StdRng::seed_from_u64(52);
    let mut candidates = vec![];
    for k in 0..400_usize {
        let (from, to) = (rng.random_range(0..50), rng.random_range(60..120));
        let mean = if k % 10 == 0 {
            walk.truth[from].between(&walk.truth[to]) * noise(&mut rng)
        } else {
            Pose2::new(rng.random_range(-9.0..9.0), rng.random_range(-9.0..9.0), rng.random())
        };
        candidates.push(if k % 20 == 0 {
            ClosureCandidate {
                from: to as u64,
                to: from as u64,
                measured: measured(mean).inverse(),
            }
        } else {
            ClosureCandidate { from: from as u64, to: to as u64, measured: measured(mean) }
        });
    }
    // As if the two halves belonged to different robots.
    let odometry = |a: u64, b: u64| {
        ((a < 60) == (b < 60)).then(|| spine.relative(a as usize, b as usize)).flatten()
    };
    let mut settings = ConsistencySettings::new(3);
    settings.max_chi2 *= 1.5;
    let set = consistent_set(&candidates, odometry, &settings);
    assert!(set.exact);
    let planted = set.members.iter().filter(|k| **k % 10 == 0).count();
    assert!(planted >= 36 && set.members.len() - planted <= 2, "{:?}", set.members);
    let sets = consistent_sets(&candidates, odometry, &settings, 3);
    assert_eq!(sets[0], set);
    assert!(sets.iter().skip(1).all(|other| other.members.len() < 15));
}

/// Gaussians along a branching tree equal those composed edge by edge.
#[test]
fn the_spine_composes_gaussians() {
    let walk = Walk::new(40, 53);
    let mut graph = Graph2::new();
    for id in 0..43 {
        graph.add_node(id, Pose2::IDENTITY).unwrap();
    }
    for k in 0..39 {
        let edge = walk.graph.edges()[k];
        if k % 2 == 0 {
            graph.add_edge(edge).unwrap();
        } else {
            add(&mut graph, k + 1, k, edge.from_from_to.inverse(), EdgeKind::Sequential);
        }
    }
    let branch = Pose2::new(0.5, 0.2, 1.0);
    add(&mut graph, 17, 40, branch, EdgeKind::Sequential);
    add(&mut graph, 40, 41, branch, EdgeKind::Sequential);
    let spine = Spine::new(&graph);
    let compose = |path: &[usize]| {
        path.windows(2).fold(GaussianPose2::exact(Pose2::IDENTITY), |sum, ends| {
            let ends = [ends[0] as u64, ends[1] as u64];
            let edge = graph
                .edges()
                .iter()
                .find(|edge| [edge.from, edge.to] == ends || [edge.to, edge.from] == ends);
            let edge = edge.unwrap();
            let step = edge.gaussian().unwrap();
            sum.compose(&if edge.from == ends[0] { step } else { step.inverse() })
        })
    };
    for path in [
        (3..=30).collect::<Vec<_>>(),
        (3..=30).rev().collect(),
        [41, 40].into_iter().chain(17..=39).collect(),
        (0..=17).chain([40, 41]).collect(),
    ] {
        let expected = compose(&path);
        let got = spine.relative(path[0], path[path.len() - 1]).unwrap();
        assert!(got.mean.between(&expected.mean).norm() < 1e-9);
        let difference = (got.covariance - expected.covariance).norm();
        assert!(difference < 1e-9 * (1.0 + expected.covariance.norm()), "{path:?} {difference}");
    }
    assert!(spine.relative(3, 42).is_none());
}
