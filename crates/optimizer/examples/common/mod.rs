//! CPU time, truth files and the absolute trajectory error.

// No example uses all of it.
#![allow(dead_code)]

use geometry::Pose2;
use manifoldslam_optimizer::{Optimizer, OptimizerError, PoseGraph};
use std::path::Path;
use std::time::Instant;

/// Measures the CPU time of this thread, where Linux tells it, and wall time elsewhere: other load
/// on the machine then disturbs less.
pub struct CpuClock {
    wall: Instant,
    cpu: Option<u64>,
}

impl CpuClock {
    /// Starts a clock.
    pub fn start() -> Self {
        CpuClock { wall: Instant::now(), cpu: cpu_nanoseconds() }
    }

    /// Milliseconds since the start.
    pub fn elapsed_ms(&self) -> f64 {
        match (self.cpu, cpu_nanoseconds()) {
            (Some(start), Some(now)) => (now - start) as f64 * 1e-6,
            _ => self.wall.elapsed().as_secs_f64() * 1e3,
        }
    }
}

fn cpu_nanoseconds() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

/// The poses of a graph in the order of its nodes.
pub fn poses(graph: &PoseGraph<Pose2, 3>) -> Vec<Pose2> {
    graph.nodes().iter().map(|node| node.pose).collect()
}

/// The true trajectory of `GRAPH.g2o` from `GRAPH.truth.txt`, if there is one.
pub fn truth(graph: &Path) -> Option<Vec<Pose2>> {
    let text = std::fs::read_to_string(graph.with_extension("truth.txt")).ok()?;
    let mut trajectory = vec![Pose2::IDENTITY];
    for line in text.lines() {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|f| f.parse().ok()).collect();
        let &[from, to, x, y, yaw, ..] = numbers.as_slice() else { continue };
        if to == from + 1.0 && to as usize == trajectory.len() {
            trajectory.push(trajectory[from as usize] * Pose2::new(x, y, yaw));
        }
    }
    Some(trajectory)
}

/// Root mean square distance of `estimate` from `reference`, in metres, after the rigid motion that
/// makes it smallest (Horn 1987, in the plane).
pub fn ate(reference: &[Pose2], estimate: &[Pose2]) -> f64 {
    let n = reference.len() as f64;
    let centre = |poses: &[Pose2]| {
        let sum = poses.iter().fold((0.0, 0.0), |s, p| (s.0 + p.x, s.1 + p.y));
        (sum.0 / n, sum.1 / n)
    };
    let (a, b) = (centre(reference), centre(estimate));
    let pairs = || {
        reference.iter().zip(estimate).map(|(r, e)| (r.x - a.0, r.y - a.1, e.x - b.0, e.y - b.1))
    };
    let (cos, sin) = pairs()
        .fold((0.0, 0.0), |s, (rx, ry, ex, ey)| (s.0 + ex * rx + ey * ry, s.1 + ex * ry - ey * rx));
    let (sin, cos) = f64::atan2(sin, cos).sin_cos();
    let squares: f64 = pairs()
        .map(|(rx, ry, ex, ey)| {
            (cos * ex - sin * ey - rx).powi(2) + (sin * ex + cos * ey - ry).powi(2)
        })
        .sum();
    (squares / n).sqrt()
}

/// Root mean square of the positions' marginal standard deviations, metres, scaled by the graph's
/// a-posteriori variance factor.
pub fn own_uncertainty(
    graph: &PoseGraph<Pose2, 3>,
    optimizer: &mut Optimizer<Pose2, 3>,
) -> Result<f64, OptimizerError> {
    let ids: Vec<u64> = graph.nodes().iter().map(|node| node.id).collect();
    let marginals = optimizer.marginals(graph, &ids)?;
    let variances = ids.iter().filter_map(|&id| marginals.covariance(id, id));
    let sum: f64 = variances.map(|c| c[(0, 0)] + c[(1, 1)]).sum();
    let freedom = 3 * (graph.edges().len() + 1 - ids.len());
    let variance_factor = graph.chi2() / freedom as f64;
    Ok((variance_factor * sum / ids.len() as f64).sqrt())
}
