//! Adds random false closures to graphs and optimises them robustly from odometry.
//!
//! `cargo run --release -p manifoldslam-optimizer --example outliers -- SEEDS GRAPH.g2o...`,
//! with seeds as `20` for 0 to 19 or as `100..120`.
//!
//! "x % false" means that x % of all closures are false once they have been added: at 80 % there
//! are four false closures to a true one. With `--of-true` as the first argument it means x false
//! closures per hundred true ones. A false closure joins two random nodes that do not follow each
//! other, by a relative pose drawn evenly from the disc of the true closures' translations and all
//! rotations, with the information of a random true closure. Nothing tells the optimiser which they
//! are, and the poses of the file are not used.
//!
//! Errors are root mean squares after rigid alignment. Where truth is known (`GRAPH.truth.txt`),
//! the bar is the ratio of the result's error to that of the clean graph's optimum. Where it is
//! not, the clean optimum itself is the reference; beside the distance from it, a ratio is given
//! that takes the clean optimum's own uncertainty for its unknown error:
//! `sqrt(sigma^2 + distance^2) / sigma`, with sigma the root mean square of the marginal standard
//! deviations of the positions about the first node, scaled by the clean graph's a-posteriori
//! variance factor (its information matrices understate how good it is).

mod common;

use common::{CpuClock, ate, own_uncertainty, poses, truth};
use geometry::Pose2;
use logs::g2o::{Graph, open_g2o};
use manifoldslam_optimizer::{
    Edge, EdgeKind, Optimizer, PoseGraph, RobustSettings, Settings, optimize_robust,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::ops::Range;
use std::path::Path;

type Failure = Box<dyn std::error::Error>;
type Graph2 = PoseGraph<Pose2, 3>;

fn main() -> Result<(), Failure> {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let of_true = args.first().is_some_and(|a| a == "--of-true");
    if of_true {
        args.remove(0);
    }
    let (seeds, graphs) = args.split_first().ok_or("arguments: SEEDS GRAPH.g2o...")?;
    let (first, end) = seeds.split_once("..").unwrap_or(("0", seeds));
    let seeds = first.parse()?..end.parse()?;
    for path in graphs {
        let experiment = Experiment::new(Path::new(path))?;
        for percent in [0, 10, 30, 50, 80] {
            let share = if of_true { 100 } else { 100 - percent };
            let count = experiment.closures.len() * percent / share;
            experiment.run(&format!("{percent} %"), count, seeds.clone())?;
        }
    }
    Ok(())
}

/// A graph, what is known of its truth, and its clean optimum.
struct Experiment {
    clean: Graph2,
    closures: Vec<usize>,
    /// Largest translation of a closure, metres.
    range: f64,
    reference: Vec<Pose2>,
    /// Error of the clean optimum: against truth, or as its own covariance has it.
    error: f64,
    has_truth: bool,
}

impl Experiment {
    fn new(path: &Path) -> Result<Self, Failure> {
        let Graph::Plane(mut clean) = open_g2o(path)?.graph else {
            return Err("only SE(2) graphs".into());
        };
        let mut optimizer = Optimizer::new();
        optimizer.optimize(&mut clean, &Settings::default())?;
        let edges = clean.edges().iter().enumerate();
        let closures: Vec<usize> =
            edges.filter(|(_, e)| e.kind == EdgeKind::Closure).map(|(k, _)| k).collect();
        let norm = |&e: &usize| clean.edges()[e].from_from_to.norm();
        let range = closures.iter().map(norm).fold(0.0, f64::max);
        let truth = truth(path);
        let error = match &truth {
            Some(truth) => ate(truth, &poses(&clean)),
            None => own_uncertainty(&clean, &mut optimizer)?,
        };
        let has_truth = truth.is_some();
        let reference = truth.unwrap_or_else(|| poses(&clean));
        let kind = if has_truth { "ATE against truth" } else { "own standard deviation" };
        println!("{}", path.file_name().unwrap_or_default().to_string_lossy());
        println!("  {} true closures; clean optimum: {kind} {error:.4} m", closures.len());
        Ok(Experiment { clean, closures, range, reference, error, has_truth })
    }

    /// One row of the table: all seeds with `count` false closures.
    fn run(&self, label: &str, count: usize, seeds: Range<u64>) -> Result<(), Failure> {
        let (mut errors, mut ratios, mut times) = (vec![], vec![], vec![]);
        let (mut missed, mut wrong) = (0, 0);
        for seed in seeds.clone() {
            let mut graph = self.clean.clone();
            self.spoil(&mut graph, count, &mut StdRng::seed_from_u64(seed))?;
            let clock = CpuClock::start();
            let result = optimize_robust(&mut graph, &RobustSettings::new(3))?;
            times.push(clock.elapsed_ms());
            let error = ate(&self.reference, &poses(&graph));
            let total = if self.has_truth { error } else { self.error.hypot(error) };
            errors.push(error);
            ratios.push(total / self.error);
            missed += self.closures.iter().filter(|&&edge| !result.inliers[edge]).count();
            let added = &result.inliers[self.clean.edges().len()..];
            wrong += added.iter().filter(|inlier| **inlier).count();
        }
        for list in [&mut errors, &mut ratios, &mut times] {
            list.sort_by(f64::total_cmp);
        }
        let (middle, last) = (errors.len() / 2, errors.len() - 1);
        println!(
            "  {label:>5} false ({count:>4}): ATE m median {:.4} worst {:.4}; ratio median {:.3} \
             worst {:.3}; true refused {missed}, false kept {wrong}, seeds {seeds:?}; \
             CPU ms median {:.0}",
            errors[middle], errors[last], ratios[middle], ratios[last], times[middle],
        );
        Ok(())
    }

    fn spoil(&self, graph: &mut Graph2, count: usize, rng: &mut StdRng) -> Result<(), Failure> {
        let nodes = graph.nodes().len();
        for _ in 0..count {
            let (from, to) = loop {
                let pair = (rng.random_range(0..nodes), rng.random_range(0..nodes));
                if pair.0.abs_diff(pair.1) > 1 {
                    break pair;
                }
            };
            let yaw = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
            let bearing = rng.random_range(0.0..std::f64::consts::TAU);
            let distance = self.range * rng.random::<f64>().sqrt();
            let (sin, cos) = bearing.sin_cos();
            let pose = Pose2::new(distance * cos, distance * sin, yaw);
            let model = self.closures[rng.random_range(0..self.closures.len())];
            let information = self.clean.edges()[model].information;
            let (from, to) = (graph.nodes()[from].id, graph.nodes()[to].id);
            graph.add_edge(Edge::new(from, to, pose, information, EdgeKind::Closure))?;
        }
        Ok(())
    }
}
