//! Two robots that do not know each other's frame, joined by closures most of which are false.
//!
//! `cargo run --release -p manifoldslam-optimizer --example two_robots -- FOLDER [SEEDS]`
//!
//! FOLDER holds `CSAIL.g2o` (the clean graph), `CSAIL_robot1.g2o` and `CSAIL_robot2.g2o` (their
//! odometry), and the closures without and with outliers, `CSAIL_interrobot_loop_closures.g2o` and
//! `CSAIL_interrobot_loop_closures_outliers.g2o`. The odometry edge that joins the robots in the
//! clean graph is left out, and the second robot starts from its own origin. Every edge of the
//! closures' files counts as a closure, whatever it joins.
//!
//! With SEEDS (20 when missing) the true closures are spoilt anew, with 50, 250 and 500 false ones:
//! *uniform* ones join random nodes by a relative pose from the disc of the true closures'
//! translations; *groups* of 5 to 10 claim that a random place of the first robot is one of the
//! second, by one random relative pose, as perceptual aliasing does, and agree with one another up
//! to the noise their information tells. Errors are as in the example `outliers`: root mean square
//! distance from the clean optimum after rigid alignment, and `sqrt(sigma^2 + distance^2) / sigma`
//! with the clean optimum's own standard deviation `sigma`.

mod common;

use common::{CpuClock, ate, own_uncertainty, poses};
use geometry::{LieGroup, Pose2, Vector3};
use logs::g2o::{Graph, open_g2o};
use manifoldslam_optimizer::{
    Edge, EdgeKind, Optimizer, PoseGraph, RobustSettings, Settings, optimize_robust,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::path::Path;

type Failure = Box<dyn std::error::Error>;
type Graph2 = PoseGraph<Pose2, 3>;
type Edge2 = Edge<Pose2, 3>;

fn main() -> Result<(), Failure> {
    let mut args = std::env::args().skip(1);
    let folder = args.next().ok_or("arguments: FOLDER [SEEDS]")?;
    let seeds: u64 = args.next().map_or(Ok(20), |text| text.parse())?;
    let team = Team::read(Path::new(&folder))?;
    println!(
        "{} nodes, {} true closures; own standard deviation of the clean optimum {:.4} m",
        team.reference.len(),
        team.right.len(),
        team.sigma
    );
    team.report("without outliers", &[vec![]])?;
    team.report("the file's outliers", std::slice::from_ref(&team.wrong))?;
    for count in [50, 250, 500] {
        for (kind, draw) in [("uniform", Team::uniform as Draw), ("groups", Team::groups)] {
            let draws: Vec<_> = (0..seeds)
                .map(|seed| draw(&team, count, &mut StdRng::seed_from_u64(seed)))
                .collect();
            team.report(&format!("{count} {kind}, {seeds} seeds"), &draws)?;
        }
    }
    Ok(())
}

type Draw = fn(&Team, usize, &mut StdRng) -> Vec<Edge2>;

/// What the robots know, and what is known of the truth.
struct Team {
    /// Both robots' odometry, each from its own origin.
    alone: Graph2,
    /// Number of the first robot's nodes.
    first: usize,
    right: Vec<Edge2>,
    wrong: Vec<Edge2>,
    reference: Vec<Pose2>,
    sigma: f64,
    /// Largest translation of a true closure, metres.
    range: f64,
}

impl Team {
    fn read(folder: &Path) -> Result<Self, Failure> {
        let read = |name: &str| match open_g2o(&folder.join(name))?.graph {
            Graph::Plane(graph) => Ok::<_, Failure>(graph),
            Graph::Space(_) => Err("only SE(2) graphs".into()),
        };
        let mut clean = read("CSAIL.g2o")?;
        let mut optimizer = Optimizer::new();
        optimizer.optimize(&mut clean, &Settings::default())?;
        let sigma = own_uncertainty(&clean, &mut optimizer)?;
        let mut alone = Graph2::new();
        let robots = [read("CSAIL_robot1.g2o")?, read("CSAIL_robot2.g2o")?];
        for robot in &robots {
            for node in robot.nodes() {
                alone.add_node(node.id, node.pose)?;
            }
            for edge in robot.edges() {
                alone.add_edge(*edge)?;
            }
        }
        let closure = |edge: &Edge2| Edge { kind: EdgeKind::Closure, ..*edge };
        let right = read("CSAIL_interrobot_loop_closures.g2o")?;
        let right: Vec<_> = right.edges().iter().map(closure).collect();
        let all = read("CSAIL_interrobot_loop_closures_outliers.g2o")?;
        let all = all.edges().iter().map(closure);
        let wrong = all.filter(|edge| !right.contains(edge)).collect();
        let range = right.iter().map(|edge| edge.from_from_to.norm()).fold(0.0, f64::max);
        let reference = alone.nodes().iter().map(|node| clean.pose(node.id).copied());
        let reference = reference.collect::<Option<_>>().ok_or("robots beyond the clean graph")?;
        let first = robots[0].nodes().len();
        Ok(Team { alone, first, right, wrong, reference, sigma, range })
    }

    /// Prints one line for some draws of false closures.
    fn report(&self, label: &str, draws: &[Vec<Edge2>]) -> Result<(), Failure> {
        let (mut errors, mut times) = (vec![], vec![]);
        let (mut kept, mut refused, mut wrong) = (0, 0, 0);
        let mut misses = 0;
        for draw in draws {
            let mut graph = self.alone.clone();
            for edge in self.right.iter().chain(draw) {
                graph.add_edge(*edge)?;
            }
            let clock = CpuClock::start();
            let result = optimize_robust(&mut graph, &RobustSettings::new(3))?;
            times.push(clock.elapsed_ms());
            errors.push(ate(&self.reference, &poses(&graph)));
            let closures = &result.inliers[self.alone.edges().len()..];
            let (right, false_ones) = closures.split_at(self.right.len());
            let here = right.iter().filter(|inlier| **inlier).count();
            let out = false_ones.iter().filter(|inlier| !**inlier).count();
            (kept, refused, wrong) = (kept + here, refused + out, wrong + draw.len());
            let ratio = self.sigma.hypot(errors[errors.len() - 1]) / self.sigma;
            let most_true = 100 * here >= 98 * self.right.len();
            misses += usize::from(ratio > 1.1 || !most_true || 100 * out < 99 * draw.len());
        }
        errors.sort_by(f64::total_cmp);
        times.sort_by(f64::total_cmp);
        let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
        let all_right = draws.len() * self.right.len();
        println!(
            "{label}: distance m median {median:.4} worst {worst:.4}; ratio median {:.3} worst \
             {:.3}; true kept {kept} of {all_right}, false refused {refused} of {wrong}; \
             draws that miss the bar {misses}; CPU ms median {:.0}",
            self.sigma.hypot(median) / self.sigma,
            self.sigma.hypot(worst) / self.sigma,
            times[times.len() / 2],
        );
        Ok(())
    }

    fn uniform(&self, count: usize, rng: &mut StdRng) -> Vec<Edge2> {
        let draw = |_| {
            let (from, to) = loop {
                let pair = [(); 2].map(|()| rng.random_range(0..self.reference.len()));
                if pair[0].abs_diff(pair[1]) > 1 {
                    break (pair[0], pair[1]);
                }
            };
            let pose = self.random_pose(rng);
            self.closure(from, to, pose, rng)
        };
        (0..count).map(draw).collect()
    }

    fn groups(&self, count: usize, rng: &mut StdRng) -> Vec<Edge2> {
        let mut edges = vec![];
        let nodes = self.reference.len();
        while edges.len() < count {
            let size = rng.random_range(5..=10).min(count - edges.len());
            // Near each other along each robot's way, within the reach of the closures.
            let a = rng.random_range(0..=self.first - 10);
            let b = rng.random_range(self.first..=nodes - 10);
            let claimed = self.random_pose(rng);
            for _ in 0..size {
                let (from, to) = (a + rng.random_range(0..10), b + rng.random_range(0..10));
                let start = self.reference[from].between(&self.reference[a]);
                let end = self.reference[b].between(&self.reference[to]);
                let mut edge = self.closure(from, to, start * claimed * end, rng);
                if let Some(root) = edge.information.try_inverse().and_then(|c| c.cholesky()) {
                    let noise = root.l() * Vector3::from_fn(|_, _| normal(rng));
                    edge.from_from_to = edge.from_from_to.retract(&noise);
                }
                edges.push(edge);
            }
        }
        edges
    }

    fn random_pose(&self, rng: &mut StdRng) -> Pose2 {
        let yaw = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
        let bearing = rng.random_range(0.0..std::f64::consts::TAU);
        let distance = self.range * rng.random::<f64>().sqrt();
        Pose2::new(distance * bearing.cos(), distance * bearing.sin(), yaw)
    }

    fn closure(&self, from: usize, to: usize, pose: Pose2, rng: &mut StdRng) -> Edge2 {
        let information = self.right[rng.random_range(0..self.right.len())].information;
        let id = |index: usize| self.alone.nodes()[index].id;
        Edge::new(id(from), id(to), pose, information, EdgeKind::Closure)
    }
}

/// Twelve uniform variables make a Gaussian one near enough.
fn normal(rng: &mut StdRng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}
