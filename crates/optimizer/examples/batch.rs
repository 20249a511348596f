//! Optimises g2o files from their own start and prints time, cost and error.
//!
//! `cargo run --release -p manifoldslam-optimizer --example batch -- REPEATS GRAPH.g2o...`
//! A file `GRAPH.truth.txt` beside a graph (iSAM edges) is used as ground truth.

use logs::g2o::{Graph, open_g2o};
use manifoldslam_optimizer::{Optimizer, Settings};
use std::time::Instant;

fn main() {
    let mut args = std::env::args().skip(1);
    let repeats: usize = args.next().and_then(|a| a.parse().ok()).unwrap_or(1);
    for path in args {
        let file = open_g2o(path.as_ref()).expect("readable");
        let Graph::Plane(start) = file.graph else { continue };
        println!(
            "{path}: {} nodes {} edges chi2 {} unplaced {} dropped {}",
            start.nodes().len(),
            start.edges().len(),
            start.chi2(),
            file.unplaced,
            file.dropped_count
        );
        for _ in 0..repeats {
            let mut graph = start.clone();
            let mut opt = Optimizer::new();
            let t = Instant::now();
            let report = opt.optimize(&mut graph, &Settings::default()).expect("ok");
            let t1 = t.elapsed();
            let mut g2 = start.clone();
            let t = Instant::now();
            opt.optimize(&mut g2, &Settings::default()).expect("ok");
            let t2 = t.elapsed();
            println!(
                "cold {:?} warm structure {:?} iterations {} {:?} cost {} -> {} chi2/2 {}",
                t1,
                t2,
                report.iterations,
                report.status,
                report.initial_cost,
                report.final_cost,
                graph.chi2() / 2.0
            );
        }
    }
}
