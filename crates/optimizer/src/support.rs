use crate::gate::{chi2_quantile, mahalanobis, poisson_tail};
use crate::spine::{Spine, covariance_of};
use crate::{EdgeKind, PoseGraph};
use geometry::{Gaussian, LieGroup};
use nalgebra::SMatrix;
use std::f64::consts::PI;

/// How far along the spine, in nodes, two closures may lie apart and still vouch for each other.
const WINDOW: u32 = 25;
/// Most neighbours one closure is compared with.
const MAX_TESTS: usize = 200;
/// Closures expected to be vouched for by chance alone, in the whole graph.
const EXPECTED_WRONG: f64 = 0.1;

/// What the closures of a graph look like as a whole.
pub(crate) struct Alternative {
    /// Volume over which the residuals of wrong closures spread.
    pub volume: f64,
    /// Squared Mahalanobis distance beyond which a closure is refused.
    pub gate: f64,
    /// How the covariances compare with what the residuals show; at most one.
    pub scale: f64,
}

/// A closure seen along the spine: from the earlier node to the later one.
struct Candidate<G, const D: usize> {
    edge: usize,
    ends: [u32; 2],
    order: [u32; 2],
    measured: Gaussian<G, D>,
}

/// Which closures are vouched for by others: closures nearby that close nearly the same loop and
/// agree with it, more of them than chance would bring.
///
/// Two closures `i -> j` and `i' -> j'` with `i` near `i'` and `j` near `j'` form a short loop with
/// the trusted paths between their ends. It is tested as in pairwise consistency maximisation
/// (Mangelsen et al. 2018, eq. 5), but only where the loop is short enough to say something: the
/// cost is linear in the number of closures, and no closure needs a good global estimate.
pub(crate) fn supported<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    spine: &Spine<G, D>,
) -> (Vec<bool>, f64) {
    let candidates = candidates(graph, spine);
    let gate = chi2_quantile(D, 0.99);
    let volume = alternative_volume(&candidates);
    let (mut agreeing, mut expected) = (vec![0; candidates.len()], vec![0.0; candidates.len()]);
    for (a, first) in candidates.iter().enumerate() {
        let mut tests = 0;
        for (b, second) in candidates.iter().enumerate().skip(a + 1) {
            if second.order[0] - first.order[0] > WINDOW || tests == MAX_TESTS {
                break;
            }
            if second.order[1].abs_diff(first.order[1]) > WINDOW {
                continue;
            }
            tests += 1;
            let Some((squared, box_volume)) = loop_test(spine, first, second) else { continue };
            let chance =
                (ball_volume(D) * gate.powf(0.5 * D as f64) * box_volume / volume).min(1.0);
            for k in [a, b] {
                expected[k] += chance;
                agreeing[k] += usize::from(squared <= gate);
            }
        }
    }
    let significance = EXPECTED_WRONG / candidates.len().max(1) as f64;
    let mut answer = vec![false; graph.edges().len()];
    for (k, candidate) in candidates.iter().enumerate() {
        answer[candidate.edge] =
            agreeing[k] > 0 && poisson_tail(expected[k], agreeing[k]) < significance;
    }
    (answer, volume)
}

fn candidates<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    spine: &Spine<G, D>,
) -> Vec<Candidate<G, D>> {
    let closures = graph.edges().iter().enumerate().filter(|(_, e)| e.kind == EdgeKind::Closure);
    let mut candidates: Vec<Candidate<G, D>> = closures
        .map(|(edge, closure)| {
            let covariance = covariance_of(&closure.information);
            let measured = Gaussian { mean: closure.from_from_to, covariance };
            let ends = graph.ends()[edge];
            let order = ends.map(|node| spine.order[node as usize]);
            if order[0] <= order[1] {
                Candidate { edge, ends, order, measured }
            } else {
                let (ends, order) = ([ends[1], ends[0]], [order[1], order[0]]);
                Candidate { edge, ends, order, measured: measured.inverse() }
            }
        })
        .collect();
    candidates.sort_by_key(|c| (c.order, c.edge));
    candidates
}

/// Squared Mahalanobis distance of one closure from the path by way of the other one, and the
/// volume of its covariance's one-sigma box.
fn loop_test<G: LieGroup<D>, const D: usize>(
    spine: &Spine<G, D>,
    a: &Candidate<G, D>,
    b: &Candidate<G, D>,
) -> Option<(f64, f64)> {
    let start = spine.relative(a.ends[0], b.ends[0])?;
    let end = spine.relative(b.ends[1], a.ends[1])?;
    let path = start.compose(&b.measured).compose(&end);
    let residual = a.measured.mean.between(&path.mean).log();
    mahalanobis(&residual, &(path.covariance + a.measured.covariance))
}

/// Volume of the unit ball.
fn ball_volume(dimension: usize) -> f64 {
    match dimension {
        0 => 1.0,
        1 => 2.0,
        d => 2.0 * PI / d as f64 * ball_volume(d - 2),
    }
}

/// The volume over which the residuals of wrong closures spread: relative positions within twice
/// the closures' own range, any rotation.
fn alternative_volume<G: LieGroup<D>, const D: usize>(candidates: &[Candidate<G, D>]) -> f64 {
    let (translations, turns) = if D == 6 { (3, 8.0 * PI * PI) } else { (2, 2.0 * PI) };
    let squares: f64 = candidates
        .iter()
        .map(|c| {
            let log: SMatrix<f64, D, 1> = c.measured.mean.log();
            log.rows(0, translations).norm_squared()
        })
        .sum();
    let range = 2.0 * (squares / candidates.len().max(1) as f64).sqrt();
    turns * ball_volume(translations) * range.powi(translations as i32)
}
