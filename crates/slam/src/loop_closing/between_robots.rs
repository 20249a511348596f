use super::candidates::{Candidate, Candidates, Looks, Query};
use super::other_robots::OtherRobots;
use super::{ClosingStatistics, Closure, LoopCloser, by_user};
use crate::SlamConfig;
use crate::map::Map;
use geometry::Pose2;
use manifold::{Islands, PatchId};
use rayon::prelude::*;

/// Looks for closures between the robots of each island, search after search.
///
/// A query that had no candidates knows every place about it well, or knows it to be elsewhere.
/// Closures found make it known better; so it is asked again only when its island was moved.
#[derive(Default)]
pub(crate) struct BetweenRobots {
    queries: Option<Vec<Asked>>,
    /// Where all patches were at the last search.
    poses: Vec<Pose2>,
}

/// A query and whether it had candidates.
struct Asked {
    query: Query,
    is_open: bool,
}

impl BetweenRobots {
    /// Searches a map that stays as it is meanwhile. What the user has taken back is not found.
    pub fn search(&mut self, map: &Map, config: &SlamConfig) -> (Vec<Closure>, ClosingStatistics) {
        let mut closer = LoopCloser::between_robots(map, config);
        let islands = map.manifold.component_map();
        let moved = self.moved(map, &islands, config.closing.every_m);
        let queries = self.queries.get_or_insert_with(|| {
            let asked = |query| Asked { query, is_open: true };
            let patches = OtherRobots::queries(map);
            patches.into_iter().filter_map(|p| closer.due(p, map).map(asked)).collect()
        });
        let candidates = &closer.candidates;
        let found: Vec<Vec<Candidate>> = queries
            .par_iter_mut()
            .map_init(Looks::new, |looks, asked| {
                let island = islands.of(asked.query.patch);
                if !asked.is_open && !moved[island] {
                    return Vec::new();
                }
                let found = candidates.of(asked.query, looks, map);
                asked.is_open = !found.is_empty();
                found
            })
            .collect();
        let of = |(asked, found): (&Asked, Vec<Candidate>)| {
            let patch = asked.query.patch;
            found.into_iter().map(move |candidate| (patch, candidate))
        };
        let pairs: Vec<(PatchId, Candidate)> = queries.iter().zip(found).flat_map(of).collect();
        let mut closures = closer.verify_all(&pairs, map);
        closures.retain(|closure| !by_user::taken_back(map, closure));
        closer.finish();
        self.poses = map.manifold.patches().iter().map(|p| p.island_from_patch).collect();
        (closures, closer.statistics)
    }

    /// The islands of which a part was moved by `least_m` or more since the last search.
    fn moved(&self, map: &Map, islands: &Islands, least_m: f64) -> Vec<bool> {
        let is_moved = |patch: &PatchId| {
            let last = self.poses.get(patch.index());
            last.is_none_or(|last| last.distance(&map.pose(*patch)) >= least_m)
        };
        islands.members.iter().map(|island| island.iter().any(is_moved)).collect()
    }
}

impl LoopCloser {
    fn between_robots(map: &Map, config: &SlamConfig) -> Self {
        let candidates = Candidates::of_others(config.closing, config.submap, map);
        LoopCloser { candidates, ..Self::new(config) }
    }
}
