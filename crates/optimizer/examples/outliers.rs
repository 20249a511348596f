//! Adds random false closures to a graph and optimises it robustly.
//!
//! `cargo run --release -p manifoldslam-optimizer --example outliers -- SEEDS GRAPH.g2o...`

use geometry::Pose2;
use logs::g2o::{Graph, open_g2o};
use manifoldslam_optimizer::*;
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::time::Instant;

fn align(reference: &[Pose2], poses: &[Pose2]) -> f64 {
    let n = reference.len() as f64;
    let mean = |p: &[Pose2]| {
        (p.iter().map(|q| q.x).sum::<f64>() / n, p.iter().map(|q| q.y).sum::<f64>() / n)
    };
    let ((ax, ay), (bx, by)) = (mean(reference), mean(poses));
    let (mut c, mut s) = (0.0, 0.0);
    for (a, b) in reference.iter().zip(poses) {
        let (px, py, qx, qy) = (b.x - bx, b.y - by, a.x - ax, a.y - ay);
        c += px * qx + py * qy;
        s += px * qy - py * qx;
    }
    let yaw = s.atan2(c);
    let (s, c) = yaw.sin_cos();
    let sum: f64 = reference
        .iter()
        .zip(poses)
        .map(|(a, b)| {
            let (px, py) = (b.x - bx, b.y - by);
            (c * px - s * py + ax - a.x).powi(2) + (s * px + c * py + ay - a.y).powi(2)
        })
        .sum();
    (sum / n).sqrt()
}

fn poses(g: &PoseGraph<Pose2, 3>) -> Vec<Pose2> {
    g.nodes().iter().map(|n| n.pose).collect()
}

fn truth(path: &str) -> Option<Vec<Pose2>> {
    let text = std::fs::read_to_string(path.replace(".g2o", ".truth.txt")).ok()?;
    let mut out = vec![Pose2::IDENTITY];
    for line in text.lines() {
        let f: Vec<&str> = line.split_whitespace().collect();
        let (i, j): (usize, usize) = (f[1].parse().ok()?, f[2].parse().ok()?);
        if j == i + 1 && j == out.len() {
            let z = Pose2::new(f[3].parse().ok()?, f[4].parse().ok()?, f[5].parse().ok()?);
            out.push(out[i] * z);
        }
    }
    Some(out)
}

fn main() {
    let mut args = std::env::args().skip(1);
    let seeds: u64 = args.next().and_then(|a| a.parse().ok()).unwrap_or(1);
    for path in args {
        let file = open_g2o(path.as_ref()).expect("readable");
        let Graph::Plane(start) = file.graph else { continue };
        let mut clean = start.clone();
        optimize(&mut clean, &Settings::default()).expect("ok");
        let reference = truth(&path).unwrap_or_else(|| poses(&clean));
        let base = align(&reference, &poses(&clean));
        let closures: Vec<usize> = (0..start.edges().len())
            .filter(|&e| start.edges()[e].kind == EdgeKind::Closure)
            .collect();
        println!("{path}: clean ATE {base:.4} closures {}", closures.len());
        let range =
            closures.iter().map(|&e| start.edges()[e].from_from_to.norm()).fold(0.0, f64::max);
        println!(
            "largest closure chi2 {}",
            closures.iter().map(|&e| clean.edge_chi2(e)).fold(0.0, f64::max)
        );
        println!("closure range {range}");
        for percent in [0, 10, 30, 50, 80] {
            let false_count = closures.len() * percent / (100 - percent);
            for seed in 0..seeds {
                let mut rng = StdRng::seed_from_u64(seed);
                let mut graph = start.clone();
                let n = graph.nodes().len();
                let mut added = 0;
                while added < false_count {
                    let (i, j) = (rng.random_range(0..n), rng.random_range(0..n));
                    if i.abs_diff(j) < 2 {
                        continue;
                    }
                    let z = loop {
                        let (x, y): (f64, f64) =
                            (rng.random_range(-range..range), rng.random_range(-range..range));
                        if x.hypot(y) <= range {
                            break Pose2::new(x, y, rng.random_range(-3.14..3.14));
                        }
                    };
                    let info =
                        start.edges()[closures[rng.random_range(0..closures.len())]].information;
                    let (a, b) = (graph.nodes()[i].id, graph.nodes()[j].id);
                    graph.add_edge(Edge::new(a, b, z, info, EdgeKind::Closure)).expect("ok");
                    added += 1;
                }
                let t = Instant::now();
                let r = optimize_robust(&mut graph, &RobustSettings::new(3)).expect("ok");
                let t = t.elapsed();
                let missed = closures.iter().filter(|&&e| !r.inliers[e]).count();
                let wrong =
                    (start.edges().len()..graph.edges().len()).filter(|&e| r.inliers[e]).count();
                let ate = align(&reference, &poses(&graph));
                println!(
                    "{percent}% seed {seed}: ATE {ate:.4} ratio {:.3} supported {} missed {missed} wrong {wrong} of {added} time {t:?} {:?}",
                    ate / base,
                    r.supported,
                    r.report.status
                );
            }
        }
    }
}
