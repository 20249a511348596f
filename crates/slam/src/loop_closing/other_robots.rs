use super::ClosingSettings;
use crate::map::Map;
use geometry::GaussianPose2;
use manifold::{INTERVAL_95, KeyPatches, PatchId, SubmapLimits};
use std::sync::OnceLock;

/// Where robots of one island may have met without knowing: what one has mapped beside the patches
/// of the others.
pub(crate) struct OtherRobots {
    settings: ClosingSettings,
    /// What is known to this standard deviation is known exactly, metres; the rest by way of key
    /// patches.
    well_known_m: f64,
    keys: KeyPatches,
    /// What each key patch's members lie within.
    extents: Vec<Extent>,
    /// For each key patch, once it is asked for, those whose members may see what its own do.
    met: Vec<OnceLock<Vec<(usize, GaussianPose2)>>>,
}

/// What the members of a key patch lie within, as seen from it.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    radius_m: f64,
    std_m: f64,
    std_rad: f64,
}

impl OtherRobots {
    /// For a map as it is now.
    pub fn new(map: &Map, settings: ClosingSettings, limits: &SubmapLimits) -> Self {
        let well_known_m = limits.translation_m / INTERVAL_95;
        let keys = KeyPatches::new(&map.manifold, well_known_m);
        let extents = (0..keys.count()).map(|key| Extent::of(&keys, key, map)).collect();
        let met = vec![OnceLock::new(); keys.count()];
        OtherRobots { settings, well_known_m, keys, extents, met }
    }

    /// Patches of robots before the query's own that may see what it sees, within `radius_m`, each
    /// as it is known from the query, by id. Of two robots only the later one's patches are
    /// queries: closures that are to agree with one another must all say where the same robot is.
    pub fn met(&self, query: PatchId, radius_m: f64, map: &Map) -> Vec<(PatchId, GaussianPose2)> {
        let robot = |patch: PatchId| map.manifold.patch(patch).robot;
        self.around(query, radius_m, |patch| robot(patch) < robot(query), map)
    }

    /// Patches that may see what a patch sees, within `radius_m`, of those that `accept` accepts.
    ///
    /// Those known well are known along the best path, others by way of key patches: not quite as
    /// well as they could be. What that costs does not grow with the island.
    pub fn around(
        &self,
        query: PatchId,
        radius_m: f64,
        accept: impl Fn(PatchId) -> bool,
        map: &Map,
    ) -> Vec<(PatchId, GaussianPose2)> {
        let Some((key, key_from_query)) = self.keys.of(query) else { return Vec::new() };
        let (own, query_from_key) = (map.pose(query), key_from_query.inverse());
        let mut found = Vec::new();
        for (other, key_from_other) in self.met[key].get_or_init(|| self.met_by(key, map)) {
            let distance = map.pose(self.keys.patch(*other)).distance(&own);
            if distance > radius_m + self.extents[*other].radius_m {
                continue;
            }
            let query_from_other = query_from_key.compose(key_from_other);
            for &patch in self.keys.members(*other).iter().filter(|patch| accept(**patch)) {
                let distance = map.pose(patch).distance(&own);
                if distance > radius_m || map.manifold.patch(patch).left_out {
                    continue;
                }
                let Some((_, other_from_patch)) = self.keys.of(patch) else { continue };
                let belief = query_from_other.compose(&other_from_patch);
                let is_near =
                    distance <= self.settings.reach_m + self.settings.sigmas * std_m(&belief);
                if is_near && map.comparable(patch, query) {
                    found.push((patch, belief));
                }
            }
        }
        if !found.is_empty() {
            let known = map.manifold.uncertainty_within(query, self.well_known_m);
            for (patch, belief) in &mut found {
                *belief = known.get(patch).copied().unwrap_or(*belief);
            }
        }
        found.sort_by_key(|(patch, _)| *patch);
        found
    }

    /// The key patches whose members may see what a key patch's own see.
    fn met_by(&self, key: usize, map: &Map) -> Vec<(usize, GaussianPose2)> {
        let own = map.pose(self.keys.patch(key));
        let near = |(other, belief): &(usize, GaussianPose2)| {
            let (a, b) = (self.extents[key], self.extents[*other]);
            let distance = map.pose(self.keys.patch(*other)).distance(&own);
            // What a turn makes of the ways behind it.
            let turned_m =
                a.std_rad * (distance + b.radius_m) + belief.covariance[(2, 2)].sqrt() * b.radius_m;
            let std_m = a.std_m + std_m(belief) + b.std_m + turned_m;
            let reach_m = self.settings.reach_m + self.settings.sigmas * std_m;
            distance - a.radius_m - b.radius_m <= reach_m
        };
        self.keys.known_from(key).into_iter().filter(near).collect()
    }

    /// The patches of all islands of several robots, robot by robot.
    pub fn queries(map: &Map) -> Vec<PatchId> {
        let robot = |patch: &PatchId| map.manifold.patch(*patch).robot;
        let islands = map.manifold.islands();
        let shared = |island: &&Vec<PatchId>| island.iter().any(|p| robot(p) != robot(&island[0]));
        let mut queries: Vec<PatchId> = islands.iter().filter(shared).flatten().copied().collect();
        queries.sort_by_key(|patch| (robot(patch), *patch));
        queries.retain(|patch| !map.manifold.patch(*patch).left_out);
        queries
    }
}

impl Extent {
    fn of(keys: &KeyPatches, key: usize, map: &Map) -> Self {
        let own = map.pose(keys.patch(key));
        keys.members(key).iter().fold(Extent::default(), |extent, &member| {
            let Some((_, belief)) = keys.of(member) else { return extent };
            Extent {
                radius_m: extent.radius_m.max(map.pose(member).distance(&own)),
                std_m: extent.std_m.max(std_m(&belief)),
                std_rad: extent.std_rad.max(belief.covariance[(2, 2)].sqrt()),
            }
        })
    }
}

/// Standard deviation of a position over both axes, metres.
fn std_m(belief: &GaussianPose2) -> f64 {
    belief.position_variance_m2().sqrt()
}
