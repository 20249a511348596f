use crate::gate::{chi2_quantile, mahalanobis, poisson_tail};
use crate::spine::{Spine, covariance_of};
use crate::{EdgeKind, PoseGraph};
use geometry::{Gaussian, LieGroup};
use std::f64::consts::PI;

/// How far along the spine, in nodes, two closures may lie apart and still vouch for each other.
const WINDOW: u32 = 25;
/// Most neighbours one closure is compared with.
const MAX_TESTS: usize = 200;
/// Closures expected to be vouched for by chance alone in the whole graph, were agreements
/// independent. They are not: who agrees with one closure of a bundle agrees with most of it. Hence
/// a small number.
const EXPECTED_WRONG: f64 = 1e-3;

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
/// (Mangelson et al. 2018, eq. 5), but only where the loop is short enough to say something: the
/// cost is linear in the number of closures, and no closure needs a good global estimate.
pub(crate) fn supported<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    spine: &Spine<G, D>,
) -> (Vec<bool>, f64) {
    let candidates = candidates(graph, spine);
    let range = closure_range(&candidates);
    let tests = compare_neighbours(spine, &candidates);
    let gate = chi2_quantile(D, 0.99) * loop_scale::<D>(&tests);
    let gate_ball = ball_volume(D) * gate.powf(0.5 * D as f64);
    let (mut agreeing, mut expected) = (vec![0; candidates.len()], vec![0.0; candidates.len()]);
    let mut reaches = 0.0;
    for test in &tests {
        // Residuals of wrong closures spread over what the closures and the legs can reach.
        let reach = range + test.legs;
        let chance = (gate_ball * test.box_volume / volume::<D>(reach)).min(1.0);
        reaches += reach;
        for k in test.pair {
            expected[k as usize] += chance;
            agreeing[k as usize] += usize::from(test.squared <= gate);
        }
    }
    let significance = EXPECTED_WRONG / candidates.len().max(1) as f64;
    let mut answer = vec![false; graph.edges().len()];
    for ((candidate, agreeing), expected) in candidates.iter().zip(agreeing).zip(expected) {
        answer[candidate.edge] = agreeing > 0 && poisson_tail(expected, agreeing) < significance;
    }
    let reach = if tests.is_empty() { range } else { reaches / tests.len() as f64 };
    (answer, volume::<D>(reach))
}

/// The loops through every closure and those near it; candidates are sorted.
fn compare_neighbours<G: LieGroup<D>, const D: usize>(
    spine: &Spine<G, D>,
    candidates: &[Candidate<G, D>],
) -> Vec<LoopTest> {
    let mut tests = vec![];
    for (a, first) in candidates.iter().enumerate() {
        let near = candidates.iter().enumerate().skip(a + 1);
        let near = near
            .take_while(|(_, second)| second.order[0] - first.order[0] <= WINDOW)
            .filter(|(_, second)| second.order[1].abs_diff(first.order[1]) <= WINDOW);
        for (b, second) in near.take(MAX_TESTS) {
            tests.extend(loop_test(spine, first, second, [a as u32, b as u32]));
        }
    }
    tests
}

/// How small the loops that agree close, beside what their covariances promise: the ratio of the
/// medians with a margin of 2.5, between a twentieth and one.
///
/// Where covariances are cautious, the plain gate lets in wrong closures whose residuals are many
/// times those of any right one.
fn loop_scale<const D: usize>(tests: &[LoopTest]) -> f64 {
    const FEWEST: usize = 30;
    let gate = chi2_quantile(D, 0.99);
    let mut agreeing: Vec<f64> = tests.iter().map(|t| t.squared).filter(|&s| s <= gate).collect();
    if agreeing.len() < FEWEST {
        return 1.0;
    }
    let middle = agreeing.len() / 2;
    let median = *agreeing.select_nth_unstable_by(middle, f64::total_cmp).1;
    (2.5 * median / chi2_quantile(D, 0.5)).clamp(0.05, 1.0)
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

/// A comparison of two closures.
struct LoopTest {
    /// Their places among the candidates.
    pair: [u32; 2],
    /// Squared Mahalanobis length of the loop's residual.
    squared: f64,
    /// Volume of the one-sigma box of the loop's covariance.
    box_volume: f64,
    /// Length of the trusted paths in the loop, metres as the crow flies.
    legs: f64,
}

/// Compares one closure with the path by way of the other one.
fn loop_test<G: LieGroup<D>, const D: usize>(
    spine: &Spine<G, D>,
    a: &Candidate<G, D>,
    b: &Candidate<G, D>,
    pair: [u32; 2],
) -> Option<LoopTest> {
    let start = spine.relative(a.ends[0] as usize, b.ends[0] as usize)?;
    let end = spine.relative(b.ends[1] as usize, a.ends[1] as usize)?;
    let path = start.compose(&b.measured).compose(&end);
    let residual = a.measured.mean.between(&path.mean).log();
    let (squared, box_volume) = mahalanobis(&residual, &(path.covariance + a.measured.covariance))?;
    let legs = translation_squared(&start.mean).sqrt() + translation_squared(&end.mean).sqrt();
    Some(LoopTest { pair, squared, box_volume, legs })
}

/// Volume of the unit ball.
fn ball_volume(dimension: usize) -> f64 {
    match dimension {
        0 => 1.0,
        1 => 2.0,
        d => 2.0 * PI / d as f64 * ball_volume(d - 2),
    }
}

/// Twice the root mean square translation of the closures: how far two of them reach, metres.
fn closure_range<G: LieGroup<D>, const D: usize>(candidates: &[Candidate<G, D>]) -> f64 {
    let squares: f64 = candidates.iter().map(|c| translation_squared(&c.measured.mean)).sum();
    2.0 * (squares / candidates.len().max(1) as f64).sqrt()
}

/// Squared length of the translation of a logarithm, which comes first in it.
fn translation_squared<G: LieGroup<D>, const D: usize>(pose: &G) -> f64 {
    pose.log().rows(0, translations(D)).norm_squared()
}

/// Volume of the poses whose translation is at most `range`, with any rotation.
fn volume<const D: usize>(range: f64) -> f64 {
    // SO(2) has the volume 2 pi, SO(3) in rotation vectors 8 pi^2.
    let rotations = if D == 6 { 8.0 * PI * PI } else { 2.0 * PI };
    rotations * ball_volume(translations(D)) * range.powi(translations(D) as i32)
}

/// Degrees of freedom of the translation: two in the plane, three in space.
fn translations(dimension: usize) -> usize {
    if dimension == 6 { 3 } else { 2 }
}
