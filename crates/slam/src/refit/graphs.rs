use crate::map::Map;
use geometry::{Matrix3, Pose2};
use manifold::{Islands, PatchId, Provenance, Relation, RelationId};
use optimizer::{
    Edge, EdgeKind, GncSettings, Optimizer, PoseGraph, Report, Settings, optimize, optimize_gnc,
};
use rayon::prelude::*;

/// One pose graph for each island: what happens to one island never shows in another's poses.
pub(super) struct IslandGraphs<'a> {
    islands: &'a Islands,
    graphs: Vec<PoseGraph<Pose2, 3>>,
}

impl<'a> IslandGraphs<'a> {
    /// The patches where they are now, without edges.
    pub fn new(map: &Map, islands: &'a Islands) -> Self {
        Self::of(map, islands, |_| true)
    }

    /// [`IslandGraphs::new`] for some of the islands alone; the others' patches stay where they
    /// are.
    pub fn of(map: &Map, islands: &'a Islands, has: impl Fn(usize) -> bool) -> Self {
        let graph = |(index, island): (usize, &Vec<PatchId>)| {
            graph_of(map, if has(index) { island } else { &[] })
        };
        let graphs = islands.members.iter().enumerate().map(graph).collect();
        IslandGraphs { islands, graphs }
    }

    /// Adds the relations that hold, each with its share of its information; returns where those
    /// are that may be doubted.
    pub fn add_relations(
        &mut self,
        map: &Map,
        share: impl Fn(&Relation) -> f64,
    ) -> Vec<((usize, usize), RelationId)> {
        let mut closures = Vec::new();
        for relation in map.manifold.active_relations() {
            if let Some(place) = self.add(relation_edge(relation, share(relation)))
                && relation.provenance != Provenance::Sequential
            {
                closures.push((place, relation.id));
            }
        }
        closures
    }

    /// Adds an edge to the graph of its island; returns where it is. Edges between islands and
    /// those that nothing can be told from are left out.
    pub fn add(&mut self, edge: Edge<Pose2, 3>) -> Option<(usize, usize)> {
        let island = |end: u64| self.islands.of(PatchId(end as u32));
        let (from, to) = (island(edge.from), island(edge.to));
        (from == to).then_some(())?;
        self.graphs[from].add_edge(edge).ok().map(|index| (from, index))
    }

    /// Optimises every graph and moves the patches; the solver's reports in the order of the
    /// islands, `None` where there was nothing to do or the solver failed.
    pub fn solve(mut self, map: &mut Map, settings: &Settings) -> Vec<Option<Report>> {
        let solve = |graph: &mut PoseGraph<Pose2, 3>| {
            (!graph.edges().is_empty()).then(|| optimize(graph, settings).ok()).flatten()
        };
        let reports: Vec<Option<Report>> = self.graphs.par_iter_mut().map(solve).collect();
        let solved = self.graphs.iter().zip(&reports).filter(|(_, report)| report.is_some());
        let nodes = solved.flat_map(|(graph, _)| graph.nodes());
        map.manifold.refit(nodes.map(|n| (PatchId(n.id as u32), n.pose)).collect());
        reports
    }
}

/// The patches of an island where they are now, without edges.
fn graph_of(map: &Map, island: &[PatchId]) -> PoseGraph<Pose2, 3> {
    let mut graph = PoseGraph::new();
    for &patch in island {
        // Ids are unique by construction.
        let _ = graph.add_node(patch.0.into(), map.pose(patch));
    }
    graph
}

/// A relation as an edge with a share of its information.
fn relation_edge(relation: &Relation, share: f64) -> Edge<Pose2, 3> {
    let kind = match relation.provenance {
        Provenance::Sequential => EdgeKind::Sequential,
        _ => EdgeKind::Closure,
    };
    let gaussian = &relation.from_from_to;
    let information = gaussian.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) * share;
    Edge::new(relation.from.0.into(), relation.to.0.into(), gaussian.mean, information, kind)
}

/// Solves one island with some of its relations in doubt (graduated non-convexity, Yang et al.
/// 2020) and moves its patches; returns the doubted relations that contradict the rest.
pub(super) fn doubt(map: &mut Map, island: &[PatchId], doubted: &[RelationId]) -> Vec<RelationId> {
    let mut graph = graph_of(map, island);
    let mut places = Vec::new();
    for &patch in island {
        for relation in map.manifold.relations_at(patch).filter(|r| r.from == patch) {
            let is_doubted = doubted.contains(&relation.id);
            let kind = if is_doubted { EdgeKind::Closure } else { EdgeKind::Sequential };
            let edge = Edge { kind, ..relation_edge(relation, 1.0) };
            if let Ok(index) = graph.add_edge(edge)
                && is_doubted
            {
                places.push((index, relation.id));
            }
        }
    }
    let settings = GncSettings::new(3);
    let Ok(report) = optimize_gnc(&mut Optimizer::new(), &mut graph, &settings) else {
        return Vec::new();
    };
    let nodes = graph.nodes().iter();
    map.manifold.refit(nodes.map(|n| (PatchId(n.id as u32), n.pose)).collect());
    let refused = places.into_iter().filter(|(edge, _)| report.weights[*edge] < 0.5);
    refused.map(|(_, id)| id).collect()
}
