use crate::{Patch, PatchId, Provenance, Relation, RelationId};
use geometry::{GaussianPose2, Pose2};
use sensing::{RobotId, Scan, Stamp};
use std::sync::Arc;

/// All patches and relations of a team.
#[derive(Clone, Debug, Default)]
pub struct Manifold {
    patches: Vec<Patch>,
    relations: Vec<Relation>,
    /// Relations at each patch, retracted ones excluded, in order of creation.
    adjacent: Vec<Vec<RelationId>>,
}

impl Manifold {
    /// An empty map.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a patch without relations: the start of an island, until it is related.
    pub fn add_patch(
        &mut self,
        robot: RobotId,
        stamp: Stamp,
        scan: Arc<Scan>,
        base_from_laser: Pose2,
        island_from_patch: Pose2,
    ) -> PatchId {
        let id = PatchId(self.patches.len() as u32);
        let patch = Patch { id, robot, stamp, scan, base_from_laser, island_from_patch };
        self.patches.push(patch);
        self.adjacent.push(Vec::new());
        id
    }

    /// Relates two patches.
    pub fn relate(
        &mut self,
        from: PatchId,
        to: PatchId,
        from_from_to: GaussianPose2,
        provenance: Provenance,
    ) -> RelationId {
        let id = RelationId(self.relations.len() as u32);
        self.relations.push(Relation { id, from, to, from_from_to, provenance, retracted: false });
        self.adjacent[from.index()].push(id);
        self.adjacent[to.index()].push(id);
        id
    }

    /// Takes a relation back. It stays on record but is no longer part of the map.
    pub fn retract(&mut self, id: RelationId) {
        let relation = &mut self.relations[id.index()];
        relation.retracted = true;
        for end in [relation.from, relation.to] {
            self.adjacent[end.index()].retain(|&r| r != id);
        }
    }

    /// Replaces a relation's Gaussian by a better measurement of the same thing.
    pub fn remeasure(&mut self, id: RelationId, from_from_to: GaussianPose2) {
        self.relations[id.index()].from_from_to = from_from_to;
    }

    /// All patches in order of creation.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// One patch.
    pub fn patch(&self, id: PatchId) -> &Patch {
        &self.patches[id.index()]
    }

    /// Moves a patch within its island.
    pub fn set_pose(&mut self, id: PatchId, island_from_patch: Pose2) {
        self.patches[id.index()].island_from_patch = island_from_patch;
    }

    /// All relations on record in order of creation, retracted ones included.
    pub fn relations(&self) -> &[Relation] {
        &self.relations
    }

    /// One relation.
    pub fn relation(&self, id: RelationId) -> &Relation {
        &self.relations[id.index()]
    }

    /// The relations that are part of the map.
    pub fn active_relations(&self) -> impl Iterator<Item = &Relation> {
        self.relations.iter().filter(|r| !r.retracted)
    }

    /// The neighbours of a patch: the other end and `patch_from_other`.
    pub fn neighbours(&self, id: PatchId) -> impl Iterator<Item = (PatchId, GaussianPose2)> + '_ {
        self.adjacent[id.index()]
            .iter()
            .filter_map(move |r| self.relations[r.index()].seen_from(id))
    }

    /// The connected components: each a sorted list of patches, in the order of their first patch.
    pub fn islands(&self) -> Vec<Vec<PatchId>> {
        let mut seen = vec![false; self.patches.len()];
        let mut islands = Vec::new();
        for start in 0..self.patches.len() {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            let mut island = vec![PatchId(start as u32)];
            let mut next = 0;
            while next < island.len() {
                for (other, _) in self.neighbours(island[next]) {
                    if !std::mem::replace(&mut seen[other.index()], true) {
                        island.push(other);
                    }
                }
                next += 1;
            }
            island.sort_unstable();
            islands.push(island);
        }
        islands
    }
}
