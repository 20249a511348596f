//! The global refit: all poses re-estimated from everything that is known.

mod breadth_first;
mod overlaps;
mod relocalise;
mod smoother;

pub(crate) use breadth_first::refit_breadth_first;
pub(crate) use relocalise::relocalise;

use crate::SlamConfig;
use crate::map::Map;
use geometry::{LieGroup, Matrix3, Pose2};
use manifold::{PatchId, Provenance, Relation, RelationId, Retraction};
use matching::{FastMatcher, FastSettings, FieldSettings};
use optimizer::{Edge, EdgeKind, Kernel, PoseGraph, Report, Settings, optimize};
use overlaps::{Overlap, measure_overlaps};
use serde::{Deserialize, Serialize};

/// Which refit runs at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RefitMethod {
    /// Overlaps of all patches are measured and all poses optimised together.
    #[default]
    Global,
    /// The thesis's algorithm 5.4: refit outwards from the closures, for comparison.
    BreadthFirst,
    /// Only the relations of the run, optimised once.
    Relations,
}

/// The global refit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RefitSettings {
    /// Which one.
    pub method: RefitMethod,
    /// Rounds of measuring overlaps and re-estimating all poses.
    pub rounds: usize,
    /// Patches farther apart are not compared, metres.
    pub overlap_distance_m: f64,
    /// At most this many overlaps are measured from each patch, the nearest first.
    pub overlaps_per_patch: usize,
    /// Smallest share of a scan that must fit for an overlap to count.
    pub overlap_share: f64,
    /// How far surfaces are felt in the refit, metres: the map is already within this of the truth.
    pub reach_m: f32,
    /// Kernel scale of the first round's measurements, metres.
    pub kernel_start_m: f64,
    /// Kernel scale of the last rounds' measurements, metres.
    pub kernel_end_m: f64,
    /// Information of an overlap is divided by this, on top of the correlation of its points: each
    /// patch's error is shared by all overlaps it is part of.
    pub overlap_sharing: f64,
    /// Residuals of odometry and relations beyond this many standard deviations are weighed down.
    pub outlier_sigmas: f64,
    /// Scans are placed in the map in groups of patches this wide, metres ...
    pub group_radius_m: f64,
    /// ... against all patches this much farther out.
    pub group_margin_m: f64,
}

impl Default for RefitSettings {
    fn default() -> Self {
        RefitSettings {
            method: RefitMethod::Global,
            rounds: 2,
            overlap_distance_m: 4.0,
            overlaps_per_patch: 10,
            overlap_share: 0.3,
            reach_m: 0.3,
            kernel_start_m: 0.1,
            kernel_end_m: 0.03,
            overlap_sharing: 15.0,
            outlier_sigmas: 2.0,
            group_radius_m: 6.0,
            group_margin_m: 6.0,
        }
    }
}

/// Re-estimates all patch poses from the relations of the run. Closures that turn out to contradict
/// the rest are retracted; returns them.
pub(crate) fn optimise_relations(map: &mut Map, config: &SlamConfig) -> Vec<RelationId> {
    let mut graph = graph_of(map);
    let mut closures = Vec::new();
    for relation in map.manifold.active_relations() {
        let edge = relation_edge(relation, 1.0);
        if let Ok(index) = graph.add_edge(edge)
            && relation.provenance != Provenance::Sequential
        {
            closures.push((index, relation.id));
        }
    }
    let report = solve(&mut graph, map, config);
    let Some(report) = report else { return Vec::new() };
    let contradicted: Vec<RelationId> = closures
        .into_iter()
        .filter(|(edge, _)| report.weights[*edge] < CONTRADICTED_WEIGHT)
        .map(|(_, id)| id)
        .collect();
    for &id in &contradicted {
        map.manifold.retract(id, Retraction::Contradicted);
    }
    contradicted
}

/// Cauchy weight of a closure seven standard deviations off, at a scale of three.
const CONTRADICTED_WEIGHT: f64 = 0.15;

/// The global pass: measure how all overlapping patches fit, re-estimate all poses, repeat with a
/// narrower kernel. Relations of the run keep the map together where nothing overlaps; odometry
/// keeps it straight along walls without features.
pub(crate) fn refit_globally(map: &mut Map, config: &SlamConfig) -> usize {
    let matcher = &config.refit_matcher();
    let settings = &config.refit;
    let mut measured = 0;
    for round in 0..settings.rounds {
        let shrink = 0.6f64.powi(round as i32);
        let kernel = (settings.kernel_start_m * shrink).max(settings.kernel_end_m);
        let overlaps = measure_overlaps(map, matcher, config, kernel as f32);
        measured += overlaps.len();
        let mut graph = graph_of(map);
        for relation in map.manifold.active_relations() {
            // Beside a ramp's walls overlaps tell little, and at its ends nothing.
            let level = map.is_level(relation.from) && map.is_level(relation.to);
            let share = if level { RELATION_SHARE } else { 1.0 };
            let _ = graph.add_edge(relation_edge(relation, share));
        }
        for way in map.manifold.ways() {
            let Some(motion) = way.motion else { continue };
            let information = motion.covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
            let (from, to) = (way.from.0.into(), way.to.0.into());
            let _ =
                graph.add_edge(Edge::new(from, to, motion.mean, information, EdgeKind::Closure));
        }
        for overlap in &overlaps {
            let _ = graph.add_edge(overlap.edge());
        }
        solve(&mut graph, map, config);
    }
    measured
}

/// Relations of the run see what overlaps see; beside them they only count this much.
const RELATION_SHARE: f64 = 0.01;

fn graph_of(map: &Map) -> PoseGraph<Pose2, 3> {
    let mut graph = PoseGraph::new();
    for patch in map.manifold.patches() {
        // Ids are unique by construction.
        let _ = graph.add_node(patch.id.0.into(), patch.island_from_patch);
    }
    graph
}

fn relation_edge(relation: &Relation, share: f64) -> Edge<Pose2, 3> {
    let kind = match relation.provenance {
        Provenance::Sequential => EdgeKind::Sequential,
        _ => EdgeKind::Closure,
    };
    let gaussian = &relation.from_from_to;
    let information = gaussian.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) * share;
    Edge::new(relation.from.0.into(), relation.to.0.into(), gaussian.mean, information, kind)
}

fn solve(graph: &mut PoseGraph<Pose2, 3>, map: &mut Map, config: &SlamConfig) -> Option<Report> {
    let settings = Settings {
        kernel: Kernel::Cauchy { scale: config.refit.outlier_sigmas },
        max_iterations: 20,
        relative_tolerance: 1e-4,
        ..Settings::default()
    };
    let report = optimize(graph, &settings).ok()?;
    let poses = graph.nodes().iter().map(|n| (PatchId(n.id as u32), n.pose)).collect();
    map.manifold.refit(poses);
    Some(report)
}

impl SlamConfig {
    /// The field of the refit: like the front end's with a shorter reach.
    fn refit_field(&self) -> FieldSettings {
        FieldSettings { reach_m: self.refit.reach_m, ..self.field }
    }

    /// The fast matcher of the refit: it starts where it expects to end.
    fn refit_matcher(&self) -> FastMatcher {
        let kernel_start_m = self.refit.kernel_start_m as f32;
        FastMatcher { settings: FastSettings { kernel_start_m, ..self.matcher } }
    }
}

impl Overlap {
    fn edge(&self) -> Edge<Pose2, 3> {
        let (from, to) = (self.from.0.into(), self.to.0.into());
        let mean = self.believed.retract(&self.step);
        Edge::new(from, to, mean, self.information, EdgeKind::Closure)
    }
}
