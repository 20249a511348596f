use crate::admission::review;
use crate::joints::{joints_along, spanning_joints};
use crate::spine::Spine;
use crate::support::{Alternative, supported};
use crate::{EdgeKind, GncSettings, Optimizer, OptimizerError, PoseGraph, Report};
use crate::{initialize_spanning_tree, optimize_gnc};
use geometry::LieGroup;
use std::cmp::Reverse;

/// Most rounds of taking closures in and out after the skeleton has been found.
const MAX_ROUNDS: usize = 20;

/// Most closures that are tried together when hardly any is vouched for.
const MAX_UNSUPPORTED: usize = 2000;

/// Settings of [`optimize_robust`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustSettings {
    /// Start from the trusted edges alone, whatever the nodes' poses are.
    pub from_odometry: bool,
    /// How the believed closures are optimised; its `inlier_chi2` is the squared Mahalanobis
    /// residual up to which a closure is believed.
    pub gnc: GncSettings,
}

impl RobustSettings {
    /// Settings for residuals of `dof` degrees of freedom.
    pub fn new(dof: usize) -> Self {
        RobustSettings { from_odometry: true, gnc: GncSettings::new(dof) }
    }
}

/// What [`optimize_robust`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustReport {
    /// The last optimisation, over the edges that were kept.
    pub report: Report,
    /// For every edge of the graph whether it was believed; sequential edges always are.
    pub inliers: Vec<bool>,
    /// Closures vouched for by their neighbours: those that the search began with.
    pub supported: usize,
}

/// Optimises a graph many of whose closures may be wrong, and says which.
///
/// 1. Closures that agree with closures nearby, beyond chance, make a skeleton. This needs only
///    the trusted edges, so it does not matter how far odometry has drifted. Parts of the graph
///    that no trusted edge joins (robots, sessions) are joined by the largest sets of closures that
///    agree with each other across them, see [`crate::find_joints`].
/// 2. The skeleton is optimised by graduated non-convexity, which throws out what does not fit.
/// 3. Every closure is judged in the light of all others: those left out are taken in where they
///    are likely right, believed ones thrown out where they contradict the rest. Then 2 again,
///    until nothing changes.
///
/// Nodes no believed closure ties to the rest stay where odometry has them.
pub fn optimize_robust<G: LieGroup<D>, const D: usize>(
    graph: &mut PoseGraph<G, D>,
    settings: &RobustSettings,
) -> Result<RobustReport, OptimizerError> {
    let spine = Spine::new(graph);
    let (mut inliers, volume) = supported(graph, &spine);
    let supported = inliers.iter().filter(|x| **x).count();
    let closures = graph.edges().iter().filter(|e| e.kind == EdgeKind::Closure).count();
    // Closures too far apart to vouch for each other: all of them are tried together.
    let all = 10 * supported < closures && closures <= MAX_UNSUPPORTED;
    for (inlier, edge) in inliers.iter_mut().zip(graph.edges()) {
        *inlier |= all || edge.kind == EdgeKind::Sequential;
    }
    believe_joints(graph, &spine, &mut inliers, all);
    if settings.from_odometry {
        let fixed: Vec<bool> = graph.nodes().iter().map(|node| node.fixed).collect();
        let mut skeleton = graph.filtered(|edge| inliers[edge]);
        initialize_spanning_tree(&mut skeleton, |node| fixed[node]);
        copy_poses(graph, &skeleton);
    }
    let model = Alternative { volume, gate: settings.gnc.inlier_chi2, scale: 1.0 };
    let mut search = Search { graph, inliers, model, optimizer: Optimizer::new() };
    let report = search.run(&settings.gnc)?;
    Ok(RobustReport { report, inliers: search.inliers, supported })
}

/// Between trees of trusted edges only the closures of the largest joints are believed at first;
/// all others are judged once those have laid the trees to each other.
///
/// Neighbours vouch for each other in a wrong bundle of closures, such as that of a repeated room,
/// as in a right one, and no trusted path is there to contradict them: the largest set decides if
/// it has half as many members again as its rival, since which of two equals is the larger is
/// decided by the closures that happen to miss a gate. Closures that nobody vouches for join
/// nothing, unless (`all`) hardly any is vouched for.
fn believe_joints<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    spine: &Spine<G, D>,
    inliers: &mut [bool],
    all: bool,
) {
    let mut joints = joints_along(graph, spine, |edge| inliers[edge]);
    for joint in &mut joints {
        // Far from the others a clique proves little: every wide gate is open.
        if !all {
            joint.members.retain(|&edge| inliers[edge]);
        }
    }
    joints.retain(|joint| 2 * joint.members.len() >= 3 * joint.rival);
    joints.sort_by_key(|joint| (Reverse(joint.members.len()), joint.trees));
    for (edge, ends) in graph.ends().iter().enumerate() {
        inliers[edge] &= spine.root(ends[0]) == spine.root(ends[1]);
    }
    for joint in spanning_joints(&joints, graph.nodes().len()) {
        for &edge in &joint.members {
            inliers[edge] = true;
        }
    }
}

/// The state of the search for the closures to believe.
struct Search<'a, G, const D: usize> {
    graph: &'a mut PoseGraph<G, D>,
    inliers: Vec<bool>,
    model: Alternative,
    optimizer: Optimizer<G, D>,
}

impl<G: LieGroup<D>, const D: usize> Search<'_, G, D> {
    fn run(&mut self, gnc: &GncSettings) -> Result<Report, OptimizerError> {
        let mut expelled = vec![false; self.inliers.len()];
        let mut round = 0;
        loop {
            let (report, kept) = self.settle(gnc)?;
            let mut review =
                review(self.graph, &kept, &mut self.optimizer, &self.inliers, &self.model)?;
            review.admit.retain(|&edge| !expelled[edge]);
            round += 1;
            if (review.admit.is_empty() && review.withdraw.is_empty()) || round == MAX_ROUNDS {
                return Ok(report);
            }
            for edge in review.withdraw {
                // After the first rounds nobody comes back, so that this ends.
                (self.inliers[edge], expelled[edge]) = (false, round > 2);
            }
            for edge in review.admit {
                self.inliers[edge] = true;
            }
        }
    }

    /// Optimises the edges believed so far, withdrawing those that do not fit; also gives the graph
    /// of what was kept.
    fn settle(&mut self, gnc: &GncSettings) -> Result<(Report, PoseGraph<G, D>), OptimizerError> {
        loop {
            let mut kept = self.graph.filtered(|edge| self.inliers[edge]);
            let gnc = GncSettings { inlier_chi2: self.model.gate * self.model.scale, ..*gnc };
            let report = optimize_gnc(&mut self.optimizer, &mut kept, &gnc)?;
            copy_poses(self.graph, &kept);
            let scale = variance_factor(&kept, &report.weights);
            let shrunk = scale < 0.8 * self.model.scale;
            self.model.scale = scale;
            let all_fit = report.weights.iter().all(|weight| *weight > 0.5);
            withdraw(&mut self.inliers, &report.weights);
            if all_fit && !shrunk {
                return Ok((report, kept));
            }
        }
    }
}

/// How large the residuals are beside what the information matrices promise: the a-posteriori
/// variance factor of adjustment theory, with a margin of 2.5 for caution, between a twentieth
/// and one.
///
/// Logs with cautious covariances are common; without this, a wrong closure passes in them whose
/// residual is far larger than any right one's.
fn variance_factor<G: LieGroup<D>, const D: usize>(
    graph: &PoseGraph<G, D>,
    weights: &[f64],
) -> f64 {
    const PRIOR: f64 = 10.0;
    let kept = weights.iter().filter(|w| **w > 0.5).count();
    let chi2: f64 = weights.iter().enumerate().map(|(e, w)| w * graph.edge_chi2(e)).sum();
    let freedom = (D * (kept + 1)).saturating_sub(D * graph.nodes().len()) as f64;
    (2.5 * (chi2 + PRIOR) / (freedom + PRIOR)).clamp(0.05, 1.0)
}

/// Marks the believed edges whose weight vanished as outliers.
fn withdraw(inliers: &mut [bool], weights: &[f64]) {
    let kept = inliers.iter_mut().filter(|inlier| **inlier);
    for (inlier, weight) in kept.zip(weights) {
        *inlier = *weight > 0.5;
    }
}

fn copy_poses<G: LieGroup<D>, const D: usize>(to: &mut PoseGraph<G, D>, from: &PoseGraph<G, D>) {
    let poses: Vec<G> = from.nodes().iter().map(|node| node.pose).collect();
    to.set_poses(&poses);
}
