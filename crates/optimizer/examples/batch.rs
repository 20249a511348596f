//! Optimises g2o files from their own start: time, cost, and error against truth where it is known.
//!
//! `cargo run --release -p manifoldslam-optimizer --example batch -- GRAPH.g2o... [--out DIR]`
//!
//! Times are CPU time (Linux; wall time elsewhere) from the graph in memory on, and cover the
//! symbolic analysis and all iterations. Ground truth is looked for beside a graph, in
//! `GRAPH.truth.txt` (iSAM edges; the odometry edges are chained). One line per graph is printed,
//! which `bench/optimizer/compare.py` reads; with
//! `--out` the optimised graphs are written as well.

mod common;

use common::{CpuClock, ate, poses, truth};
use logs::g2o::{Graph, open_g2o, write_g2o};
use manifoldslam_optimizer::{Optimizer, Settings};
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut graphs, mut out) = (vec![], None);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        if arg == "--out" { out = args.next().map(PathBuf::from) } else { graphs.push(arg) }
    }
    for path in graphs {
        run(Path::new(&path), out.as_deref())?;
    }
    Ok(())
}

fn run(path: &Path, out: Option<&Path>) -> Result<(), Box<dyn std::error::Error>> {
    let Graph::Plane(start) = open_g2o(path)?.graph else {
        return Err("only SE(2) graphs are measured".into());
    };
    let (mut graph, mut again) = (start.clone(), start.clone());
    let mut optimizer = Optimizer::new();
    let clock = CpuClock::start();
    let report = optimizer.optimize(&mut graph, &Settings::default())?;
    let cold = clock.elapsed_ms();
    let clock = CpuClock::start();
    optimizer.optimize(&mut again, &Settings::default())?;
    let warm = clock.elapsed_ms();
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    print!(
        "{name} cold_ms {:.3} warm_ms {:.3} iterations {} start_chi2 {} chi2 {}",
        cold,
        warm,
        report.iterations,
        report.initial_cost,
        graph.chi2(),
    );
    match truth(path) {
        Some(truth) => println!(" ate_m {:.6}", ate(&truth, &poses(&graph))),
        None => println!(),
    }
    if let Some(folder) = out {
        let file = std::fs::File::create(folder.join(format!("{name}.g2o")))?;
        write_g2o(std::io::BufWriter::new(file), &graph)?;
    }
    Ok(())
}
