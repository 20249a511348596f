//! Random walks on a grid of corridors, with noisy odometry and closures where they meet.

use geometry::{LieGroup, Matrix3, Pose2, Vector3};
use manifoldslam_optimizer::{Edge, EdgeKind, PoseGraph};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::f64::consts::FRAC_PI_2;

pub type Graph2 = PoseGraph<Pose2, 3>;

/// Standard deviations of every measurement: metres, metres, radians.
pub const SIGMA: [f64; 3] = [0.05, 0.05, 0.01];

pub fn information() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(SIGMA.map(|s| 1.0 / (s * s))))
}

/// Twelve uniform variables make a Gaussian one near enough.
pub fn noise(rng: &mut StdRng) -> Pose2 {
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    Pose2::exp(&Vector3::from(SIGMA.map(|s| s * normal())))
}

/// A walk, its true poses, and a graph of it that starts from odometry.
pub struct Walk {
    pub truth: Vec<Pose2>,
    pub graph: Graph2,
}

impl Walk {
    /// `nodes` steps of one metre on a grid of four-metre blocks, 24 m wide; every meeting of two
    /// parts of the walk within half a metre is a closure.
    pub fn new(nodes: usize, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let mut truth = vec![Pose2::IDENTITY];
        while truth.len() < nodes {
            let last = truth[truth.len() - 1];
            let at_corner = truth.len() % 4 == 1;
            let turn = if at_corner { rng.random_range(-1..=1_i32) } else { 0 };
            let mut next = last * Pose2::new(0.0, 0.0, FRAC_PI_2 * f64::from(turn));
            if (next * Pose2::new(4.0, 0.0, 0.0)).x.abs().max(next.y.abs()) > 13.0 {
                next = next * Pose2::new(0.0, 0.0, FRAC_PI_2);
            }
            truth.push(next * Pose2::new(1.0, 0.0, 0.0));
        }
        let mut graph = Graph2::new();
        let mut pose = Pose2::IDENTITY;
        graph.add_node(0, pose).unwrap();
        for k in 1..nodes {
            let measured = truth[k - 1].between(&truth[k]) * noise(&mut rng);
            pose = pose * measured;
            graph.add_node(k as u64, pose).unwrap();
            add(&mut graph, k - 1, k, measured, EdgeKind::Sequential);
        }
        for b in 0..nodes {
            for a in (0..b.saturating_sub(10)).filter(|&a| truth[a].distance(&truth[b]) < 0.5) {
                let measured = truth[a].between(&truth[b]) * noise(&mut rng);
                add(&mut graph, a, b, measured, EdgeKind::Closure);
            }
        }
        Walk { truth, graph }
    }

    /// Adds `count` closures between random nodes with random relative poses.
    pub fn spoil(&mut self, count: usize, seed: u64) {
        let mut rng = StdRng::seed_from_u64(seed);
        let nodes = self.truth.len();
        for _ in 0..count {
            let from = rng.random_range(0..nodes / 2);
            let to = rng.random_range(from + 10..nodes);
            let (x, y) = (rng.random_range(-2.0..2.0), rng.random_range(-2.0..2.0));
            let pose = Pose2::new(x, y, rng.random_range(-3.0..3.0));
            add(&mut self.graph, from, to, pose, EdgeKind::Closure);
        }
    }

    /// Root mean square distance from the truth; the first poses coincide.
    pub fn error(&self, graph: &Graph2) -> f64 {
        let pairs = self.truth.iter().zip(graph.nodes());
        let squares: f64 = pairs.map(|(truth, node)| truth.distance(&node.pose).powi(2)).sum();
        (squares / self.truth.len() as f64).sqrt()
    }

    pub fn closures(&self) -> usize {
        self.graph.edges().iter().filter(|edge| edge.kind == EdgeKind::Closure).count()
    }
}

pub fn add(graph: &mut Graph2, from: usize, to: usize, pose: Pose2, kind: EdgeKind) {
    let edge = Edge::new(from as u64, to as u64, pose, information(), kind);
    graph.add_edge(edge).unwrap();
}
