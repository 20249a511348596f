use crate::{Change, ManifoldError, Patch, PatchId, Provenance, Relation, RelationId};
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
    /// What happened since the journal was last taken.
    journal: Vec<Change>,
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
        self.journal.push(Change::PatchAdded(patch.clone()));
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
        let relation = Relation { id, from, to, from_from_to, provenance, retracted: false };
        self.journal.push(Change::RelationAdded(relation));
        self.relations.push(relation);
        self.adjacent[from.index()].push(id);
        self.adjacent[to.index()].push(id);
        id
    }

    /// Takes a relation back. It stays on record but is no longer part of the map.
    pub fn retract(&mut self, id: RelationId) {
        let relation = &mut self.relations[id.index()];
        if std::mem::replace(&mut relation.retracted, true) {
            return;
        }
        self.journal.push(Change::RelationRetracted(id));
        for end in [relation.from, relation.to] {
            self.adjacent[end.index()].retain(|&r| r != id);
        }
    }

    /// All patches in order of creation.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// One patch.
    pub fn patch(&self, id: PatchId) -> &Patch {
        &self.patches[id.index()]
    }

    /// Re-estimates poses: where each named patch now lies in its island.
    pub fn refit(&mut self, poses: Vec<(PatchId, Pose2)>) {
        if poses.is_empty() {
            return;
        }
        for &(patch, pose) in &poses {
            self.patches[patch.index()].island_from_patch = pose;
        }
        self.journal.push(Change::PosesReestimated(poses));
    }

    /// Takes the journal: every change since it was last taken, in order.
    ///
    /// Applying all changes of a manifold to an empty one rebuilds it (see [`Manifold::apply`]).
    pub fn take_journal(&mut self) -> Vec<Change> {
        std::mem::take(&mut self.journal)
    }

    /// Repeats a change that happened to another manifold.
    ///
    /// # Errors
    /// [`ManifoldError`] when the change does not follow on this manifold's state; nothing is
    /// changed.
    pub fn apply(&mut self, change: &Change) -> Result<(), ManifoldError> {
        let known = |p: PatchId| p.index() < self.patches.len();
        match change {
            Change::PatchAdded(p) if p.id.index() == self.patches.len() => {
                let scan = Arc::clone(&p.scan);
                self.add_patch(p.robot, p.stamp, scan, p.base_from_laser, p.island_from_patch);
            }
            Change::RelationAdded(r)
                if r.id.index() == self.relations.len() && known(r.from) && known(r.to) =>
            {
                self.relate(r.from, r.to, r.from_from_to, r.provenance);
            }
            Change::RelationRetracted(id) if id.index() < self.relations.len() => self.retract(*id),
            Change::PosesReestimated(poses) if poses.iter().all(|p| known(p.0)) => {
                self.refit(poses.clone());
            }
            _ => return Err(ManifoldError::OutOfOrder),
        }
        Ok(())
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
