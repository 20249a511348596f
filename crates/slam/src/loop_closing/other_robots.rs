use super::ClosingSettings;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use manifold::{Islands, PatchId};

/// Where robots of one island may have met without knowing: what one has mapped beside the patches
/// of the others.
pub(crate) struct OtherRobots {
    settings: ClosingSettings,
    islands: Islands,
    grid: PatchGrid,
    /// Standard deviation of every patch's position seen from its island's first patch, metres.
    std_m: Vec<f64>,
    /// The largest of each island.
    most_m: Vec<f64>,
}

/// Cells that patches are looked up in, metres.
const GRID_M: f64 = 8.0;

impl OtherRobots {
    /// For a map as it is now.
    pub fn new(map: &Map, settings: ClosingSettings) -> Self {
        let islands = map.manifold.component_map();
        let grid = PatchGrid::new(map, &islands, GRID_M);
        let mut std_m = vec![0.0; map.manifold.patches().len()];
        for island in &islands.members {
            let known = map.manifold.uncertainty_from(island[0], island);
            for patch in island {
                let Some(belief) = known[patch.index()] else { continue };
                let covariance = belief.covariance;
                std_m[patch.index()] = (covariance[(0, 0)] + covariance[(1, 1)]).sqrt();
            }
        }
        let largest = |island: &Vec<PatchId>| -> f64 {
            island.iter().map(|patch| std_m[patch.index()]).fold(0.0, f64::max)
        };
        let most_m = islands.members.iter().map(largest).collect();
        OtherRobots { settings, islands, grid, std_m, most_m }
    }

    /// Patches of robots before the query's own that may see what it sees, within `radius_m`. Of
    /// two robots only the later one's patches are queries: closures that are to agree with one
    /// another must all say where the same robot is.
    pub fn met(&self, query: PatchId, radius_m: f64, map: &Map) -> Vec<PatchId> {
        let robot = |patch: PatchId| map.manifold.patch(patch).robot;
        let mut met = self.around(query, radius_m, map);
        met.retain(|&patch| robot(patch) < robot(query));
        met
    }

    /// Patches of any robot that may see what a patch sees, within `radius_m`: no farther than the
    /// two are known to be apart, each seen from the first patch of their island. Seen from one
    /// another they are known as well or better.
    pub fn around(&self, query: PatchId, radius_m: f64, map: &Map) -> Vec<PatchId> {
        let island = self.islands.of(query);
        let own = map.pose(query);
        let std_m = self.std_m[query.index()];
        let reach = |other_m: f64| self.settings.reach_m + self.settings.sigmas * (std_m + other_m);
        let radius_m = radius_m.min(reach(self.most_m[island]));
        let mut near = self.grid.within(map, island as u32, &own, radius_m);
        near.retain(|p| map.pose(*p).distance(&own) <= reach(self.std_m[p.index()]));
        near.retain(|p| map.comparable(*p, query));
        near
    }

    /// The patches of all islands of several robots, robot by robot.
    pub fn queries(&self, map: &Map) -> Vec<PatchId> {
        let robot = |patch: &PatchId| map.manifold.patch(*patch).robot;
        let shared = |island: &&Vec<PatchId>| island.iter().any(|p| robot(p) != robot(&island[0]));
        let mut queries: Vec<PatchId> =
            self.islands.members.iter().filter(shared).flatten().copied().collect();
        queries.sort_by_key(|patch| (robot(patch), *patch));
        queries.retain(|patch| !map.manifold.patch(*patch).left_out);
        queries
    }
}
