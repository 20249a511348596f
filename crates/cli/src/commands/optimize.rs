use crate::Outcome;
use crate::args::{Global, KernelName, MethodName, OptimizeArgs};
use crate::atomic::PendingFile;
use crate::terminal::{counted, print};
use anyhow::{Context, Result, bail};
use logs::g2o::{G2oPose, Graph, open_g2o, write_g2o};
use optimizer::{
    Kernel, Method, PoseGraph, RobustScope, RobustSettings, Settings, Status,
    initialize_spanning_tree, optimize, optimize_robust,
};
use serde::Serialize;
use std::time::Instant;

/// What an optimisation did.
#[derive(Debug, Serialize)]
struct Summary {
    nodes: usize,
    edges: usize,
    unplaced_nodes: usize,
    dropped_lines: u64,
    initial_cost: f64,
    final_cost: f64,
    iterations: usize,
    status: String,
    rejected_edges: usize,
    secs: f64,
}

/// Optimises a pose graph.
pub fn run(args: &OptimizeArgs, global: &Global) -> Result<Outcome> {
    let file = open_g2o(&args.input)?;
    let output = PendingFile::create(&args.output)?;
    let lossy = file.is_lossy();
    let (unplaced, dropped) = (file.unplaced, file.dropped_count);
    let (mut summary, bytes) = match file.graph {
        Graph::Plane(graph) => solve(graph, args)?,
        Graph::Space(graph) => solve(graph, args)?,
    };
    (summary.unplaced_nodes, summary.dropped_lines) = (unplaced, dropped);
    output.commit(&bytes)?;
    let mut text = format!(
        "{}, {}: cost {:.6e} -> {:.6e} in {} and {:.3} s ({})\n",
        counted(summary.nodes as u64, "pose"),
        counted(summary.edges as u64, "edge"),
        summary.initial_cost,
        summary.final_cost,
        counted(summary.iterations as u64, "iteration"),
        summary.secs,
        summary.status,
    );
    if summary.rejected_edges > 0 {
        let rejected = counted(summary.rejected_edges as u64, "edge");
        let fate = if args.robust { "left out" } else { "given less than a tenth of its weight" };
        text.push_str(&format!("{rejected} {fate}\n"));
    }
    for line in file.dropped.iter().take(5) {
        text.push_str(&format!("LOST: {line}\n"));
    }
    if let Some(failure) = &file.failure {
        text.push_str(&format!("LOST: {failure}\n"));
    }
    print(global, &text, &summary)?;
    Ok(if lossy { Outcome::DataLost } else { Outcome::Fine })
}

/// Optimises a graph and returns its text.
fn solve<G: G2oPose<D>, const D: usize>(
    mut graph: PoseGraph<G, D>,
    args: &OptimizeArgs,
) -> Result<(Summary, Vec<u8>)> {
    if graph.nodes().is_empty() {
        bail!("{}: no poses in the file", args.input.display());
    }
    let start = Instant::now();
    if args.spanning_tree {
        initialize_spanning_tree(&mut graph, |_| false);
    }
    let settings = settings(args);
    let (report, believed) = if args.robust {
        let mut robust = RobustSettings::new(D);
        robust.gnc.inner.method = settings.method;
        robust.gnc.inner.max_iterations = settings.max_iterations;
        let found = optimize_robust(&mut graph, &robust).context("cannot optimise the graph")?;
        (found.report, Some(found.inliers))
    } else {
        (optimize(&mut graph, &settings).context("cannot optimise the graph")?, None)
    };
    let secs = start.elapsed().as_secs_f64();
    let status = match report.status {
        Status::Converged => "converged",
        Status::IterationLimit => "stopped at the limit on iterations",
        Status::Stalled => "no further step helps",
    };
    let edges = graph.edges().len();
    if let Some(believed) = &believed {
        graph = graph.filtered(|edge| believed[edge]);
    }
    let summary = Summary {
        nodes: graph.nodes().len(),
        edges,
        unplaced_nodes: 0,
        dropped_lines: 0,
        initial_cost: report.initial_cost,
        final_cost: report.final_cost,
        iterations: report.iterations,
        status: status.to_owned(),
        rejected_edges: match &believed {
            Some(believed) => believed.iter().filter(|&&b| !b).count(),
            None => report.weights.iter().filter(|&&w| w < 0.1).count(),
        },
        secs,
    };
    let mut bytes = Vec::new();
    write_g2o(&mut bytes, &graph)?;
    Ok((summary, bytes))
}

fn settings(args: &OptimizeArgs) -> Settings {
    let scale = args.scale;
    Settings {
        method: match args.method {
            MethodName::GaussNewton => Method::GaussNewton,
            MethodName::LevenbergMarquardt => Method::LevenbergMarquardt,
        },
        max_iterations: args.iterations,
        kernel: match args.kernel {
            KernelName::None => Kernel::Quadratic,
            KernelName::Huber => Kernel::Huber { scale },
            KernelName::Cauchy => Kernel::Cauchy { scale },
            KernelName::Dcs => Kernel::Dcs { scale },
            KernelName::GemanMcclure => Kernel::GemanMcClure { scale },
            KernelName::Truncated => Kernel::Truncated { scale },
        },
        scope: if args.all_edges { RobustScope::All } else { RobustScope::Closures },
        ..Settings::default()
    }
}
