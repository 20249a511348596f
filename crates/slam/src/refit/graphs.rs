use super::RefitSettings;
use crate::map::Map;
use geometry::{Matrix3, Pose2};
use manifold::{Islands, PatchId, Provenance, Relation};
use optimizer::{Edge, EdgeKind, Kernel, PoseGraph, Report, Settings, optimize};
use rayon::prelude::*;

/// One pose graph for each island: what happens to one island never shows in another's poses.
pub(super) struct IslandGraphs<'a> {
    islands: &'a Islands,
    graphs: Vec<PoseGraph<Pose2, 3>>,
}

impl<'a> IslandGraphs<'a> {
    /// The patches where they are now, without edges.
    pub fn new(map: &Map, islands: &'a Islands) -> Self {
        let graph = |island: &Vec<PatchId>| {
            let mut graph = PoseGraph::new();
            for &patch in island {
                // Ids are unique by construction.
                let _ = graph.add_node(patch.0.into(), map.pose(patch));
            }
            graph
        };
        IslandGraphs { islands, graphs: islands.members.iter().map(graph).collect() }
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
    pub fn solve(mut self, map: &mut Map, settings: &RefitSettings) -> Vec<Option<Report>> {
        let settings = Settings {
            kernel: Kernel::Cauchy { scale: settings.outlier_sigmas },
            max_iterations: 20,
            relative_tolerance: 1e-4,
            ..Settings::default()
        };
        let solve = |graph: &mut PoseGraph<Pose2, 3>| {
            (!graph.edges().is_empty()).then(|| optimize(graph, &settings).ok()).flatten()
        };
        let reports: Vec<Option<Report>> = self.graphs.par_iter_mut().map(solve).collect();
        let solved = self.graphs.iter().zip(&reports).filter(|(_, report)| report.is_some());
        let nodes = solved.flat_map(|(graph, _)| graph.nodes());
        map.manifold.refit(nodes.map(|n| (PatchId(n.id as u32), n.pose)).collect());
        reports
    }
}

/// A relation as an edge with a share of its information.
pub(super) fn relation_edge(relation: &Relation, share: f64) -> Edge<Pose2, 3> {
    let kind = match relation.provenance {
        Provenance::Sequential => EdgeKind::Sequential,
        _ => EdgeKind::Closure,
    };
    let gaussian = &relation.from_from_to;
    let information = gaussian.covariance.try_inverse().unwrap_or_else(Matrix3::zeros) * share;
    Edge::new(relation.from.0.into(), relation.to.0.into(), gaussian.mean, information, kind)
}
