//! The global refit: all poses re-estimated from everything that is known.

mod breadth_first;
mod graphs;
mod grid;
mod memory;
mod overlaps;
mod relocalise;
mod smoother;

pub(crate) use memory::Memory;
pub(crate) use relocalise::relocalise;

use crate::SlamConfig;
use crate::elevation::estimate_elevations;
use crate::map::Map;
use breadth_first::refit_breadth_first;
use geometry::{Matrix3, Pose2};
use graphs::IslandGraphs;
use manifold::{Islands, PatchId, Provenance, Relation, RelationId, Retraction};
use matching::{FastMatcher, FastSettings, FieldSettings};
use optimizer::{Edge, EdgeKind, Kernel, Settings};
use overlaps::{Overlap, measure_overlaps};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

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
    let islands = map.manifold.component_map();
    let all = (0..islands.members.len()).collect();
    optimise_islands(map, &islands, &all, config)
}

/// [`optimise_relations`] on some of the islands.
pub(crate) fn optimise_islands(
    map: &mut Map,
    islands: &Islands,
    which: &BTreeSet<usize>,
    config: &SlamConfig,
) -> Vec<RelationId> {
    let contradicted = find_contradicted(map, islands, which, config);
    for &id in &contradicted {
        map.manifold.retract(id, Retraction::Contradicted);
    }
    contradicted
}

/// [`optimise_relations`] where what was believed so far may be wrong, a merge on few places for
/// example: poses that rest on it would speak against everything else. Where something contradicts,
/// graduated non-convexity first finds what most closures agree about.
pub(crate) fn reconsider_relations(map: &mut Map, config: &SlamConfig) -> Vec<RelationId> {
    let islands = map.manifold.component_map();
    let all = (0..islands.members.len()).collect();
    let contradicted = find_contradicted(map, &islands, &all, config);
    let doubted: BTreeSet<usize> =
        contradicted.iter().map(|id| islands.of(map.manifold.relation(*id).from)).collect();
    if doubted.is_empty() {
        return contradicted;
    }
    for &island in &doubted {
        let closures = map
            .manifold
            .active_relations()
            .filter(|r| r.provenance != Provenance::Sequential && islands.of(r.from) == island);
        let closures: Vec<RelationId> = closures.map(|r| r.id).collect();
        graphs::doubt(map, &islands.members[island], &closures);
    }
    optimise_islands(map, &islands, &doubted, config)
}

/// Re-estimates the patch poses of some islands from their relations; the closures that contradict
/// the rest.
fn find_contradicted(
    map: &mut Map,
    islands: &Islands,
    which: &BTreeSet<usize>,
    config: &SlamConfig,
) -> Vec<RelationId> {
    let mut graphs = IslandGraphs::of(map, islands, |island| which.contains(&island));
    let closures = graphs.add_relations(map, |_| 1.0);
    let reports = graphs.solve(map, &config.refit.quickly());
    let weight = |(island, edge): (usize, usize)| {
        reports[island].as_ref().map_or(1.0, |report| report.weights[edge])
    };
    let doubtful = closures.into_iter().filter(|(place, _)| weight(*place) < CONTRADICTED_WEIGHT);
    doubtful.map(|(_, id)| id).collect()
}

/// Cauchy weight of a closure seven standard deviations off, at a scale of three.
const CONTRADICTED_WEIGHT: f64 = 0.15;

/// Places all patches anew from nothing but the relations that hold: every island in the frame of
/// its first patch, from the fewest relations to each patch, then optimised.
///
/// The poses are a function of the relations, the start included: how the map came about, what was
/// believed meanwhile and what has been taken back leaves no trace.
pub(crate) fn settle(map: &mut Map, config: &SlamConfig) {
    let islands = map.manifold.component_map();
    let placed = islands.members.par_iter().flat_map_iter(|island| laid_out(map, island[0]));
    let placed: Vec<(PatchId, Pose2)> = placed.collect();
    map.manifold.refit(placed);
    let mut graphs = IslandGraphs::new(map, &islands);
    graphs.add_relations(map, |_| 1.0);
    graphs.solve(map, &config.refit.strictly());
    estimate_elevations(map);
}

/// The patches of an island in the frame of one of them, each by the fewest relations.
fn laid_out(map: &Map, first: PatchId) -> Vec<(PatchId, Pose2)> {
    let mut placed = vec![(first, Pose2::IDENTITY)];
    let mut seen = BTreeSet::from([first]);
    let mut next = 0;
    while let Some(&(patch, pose)) = placed.get(next) {
        next += 1;
        for (other, step) in map.manifold.neighbours(patch) {
            if seen.insert(other) {
                placed.push((other, pose * step.mean));
            }
        }
    }
    placed
}

/// Of some relations between patches of an island, given by its patches, those that graduated
/// non-convexity finds to contradict the rest. The patches move to where the others have them.
pub(crate) fn doubt_relations(
    map: &mut Map,
    island: &[PatchId],
    doubted: &[RelationId],
) -> Vec<RelationId> {
    if doubted.is_empty() { Vec::new() } else { graphs::doubt(map, island, doubted) }
}

/// The refit that is configured; how many overlaps took part.
pub(crate) fn refit(map: &mut Map, config: &SlamConfig, memory: &mut Memory) -> usize {
    match config.refit.method {
        RefitMethod::Global => refit_globally(map, config, memory),
        RefitMethod::BreadthFirst => {
            refit_breadth_first(map, config);
            0
        }
        RefitMethod::Relations => 0,
    }
}

/// The global pass: measure how all overlapping patches fit, re-estimate all poses, repeat with a
/// narrower kernel. Relations of the run keep the map together where nothing overlaps; odometry
/// keeps it straight along walls without features.
fn refit_globally(map: &mut Map, config: &SlamConfig, memory: &mut Memory) -> usize {
    let settings = &config.refit;
    let islands = map.manifold.component_map();
    let mut counting = 0;
    memory.overlaps.resize(settings.rounds, Vec::new());
    for round in 0..settings.rounds {
        let shrink = 0.6f64.powi(round as i32);
        let kernel = (settings.kernel_start_m * shrink).max(settings.kernel_end_m);
        let overlaps = &mut memory.overlaps[round];
        measure_overlaps(overlaps, map, &islands, config, kernel as f32);
        let mut graphs = IslandGraphs::new(map, &islands);
        graphs.add_relations(map, |r| relation_share(map, r));
        for way in map.manifold.ways() {
            let Some(motion) = way.motion else { continue };
            let information = motion.covariance.try_inverse().unwrap_or_else(Matrix3::zeros);
            let (from, to) = (way.from.0.into(), way.to.0.into());
            graphs.add(Edge::new(from, to, motion.mean, information, EdgeKind::Closure));
        }
        for overlap in overlaps.iter().flatten().filter(|overlap| overlap.counts) {
            graphs.add(overlap.edge());
            counting += 1;
        }
        graphs.solve(map, &settings.quickly());
    }
    counting
}

/// Relations of the run see what overlaps see; beside them they only count this much.
const RELATION_SHARE: f64 = 0.01;

/// How much of a relation counts beside overlaps: beside a ramp's walls overlaps tell little, and
/// at its ends nothing.
fn relation_share(map: &Map, relation: &Relation) -> f64 {
    let level = map.is_level(relation.from) && map.is_level(relation.to);
    if level { RELATION_SHARE } else { 1.0 }
}

impl RefitSettings {
    /// How poses are optimised on the way: far better than they are known.
    fn quickly(&self) -> Settings {
        Settings {
            kernel: Kernel::Cauchy { scale: self.outlier_sigmas },
            max_iterations: 20,
            relative_tolerance: 1e-4,
            ..Settings::default()
        }
    }

    /// How poses are optimised from far away: until what is left to gain is far below what shows.
    fn strictly(&self) -> Settings {
        Settings { max_iterations: 100, relative_tolerance: 1e-6, ..self.quickly() }
    }
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
        Edge::new(from, to, self.from_from_to, self.information, EdgeKind::Closure)
    }
}
