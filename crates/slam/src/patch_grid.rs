use crate::map::Map;
use geometry::Pose2;
use manifold::{Islands, PatchId};
use std::collections::BTreeMap;

/// Patches by island and place, to find those near a place without looking at all.
pub(crate) struct PatchGrid {
    cell_m: f64,
    /// The patches of a cell and where they were when the grid was made.
    cells: BTreeMap<(u32, i64, i64), Vec<(PatchId, Pose2)>>,
}

impl PatchGrid {
    /// All patches that are not left out, in cells of side `cell_m`.
    pub fn new(map: &Map, islands: &Islands, cell_m: f64) -> Self {
        let mut cells: BTreeMap<_, Vec<(PatchId, Pose2)>> = BTreeMap::new();
        for patch in map.manifold.patches().iter().filter(|p| !p.left_out) {
            let pose = patch.island_from_patch;
            let (u, v) = cell_of(&pose, cell_m);
            cells.entry((islands.of[patch.id.index()], u, v)).or_default().push((patch.id, pose));
        }
        PatchGrid { cell_m, cells }
    }

    /// Patches of an island within `radius_m` of a pose, by id.
    pub fn within(&self, map: &Map, island: u32, pose: &Pose2, radius_m: f64) -> Vec<PatchId> {
        let others = self.cells_around(island, *pose, radius_m).map(|(other, _)| *other);
        let mut found: Vec<PatchId> =
            others.filter(|&other| map.pose(other).distance(pose) <= radius_m).collect();
        found.sort_unstable();
        found
    }

    /// Patches of an island within `radius_m` of a pose, in no particular order, and where they
    /// were when the grid was made.
    pub fn around(
        &self,
        island: u32,
        pose: Pose2,
        radius_m: f64,
    ) -> impl Iterator<Item = &(PatchId, Pose2)> {
        let others = self.cells_around(island, pose, radius_m);
        others.filter(move |(_, other)| other.distance(&pose) <= radius_m)
    }

    fn cells_around(
        &self,
        island: u32,
        pose: Pose2,
        radius_m: f64,
    ) -> impl Iterator<Item = &(PatchId, Pose2)> {
        let reach = (radius_m / self.cell_m).ceil() as i64;
        let (u, v) = cell_of(&pose, self.cell_m);
        (-reach..=reach)
            .flat_map(move |dv| (-reach..=reach).map(move |du| (island, u + du, v + dv)))
            .filter_map(|cell| self.cells.get(&cell))
            .flatten()
    }
}

fn cell_of(pose: &Pose2, size_m: f64) -> (i64, i64) {
    ((pose.x / size_m).floor() as i64, (pose.y / size_m).floor() as i64)
}
