use crate::{
    Change, Elevation, ManifoldError, Patch, PatchId, PatchSighting, Provenance, Relation,
    RelationId, RelationState, Retraction, Robot, Way,
};
use geometry::{GaussianPose2, Pose2};
use sensing::RobotId;
use std::sync::Arc;

/// All patches and relations of a team.
#[derive(Clone, Debug, Default)]
pub struct Manifold {
    robots: Vec<Robot>,
    patches: Vec<Patch>,
    relations: Vec<Relation>,
    ways: Vec<Way>,
    sightings: Vec<PatchSighting>,
    /// Relations at each patch, active ones alone, in order of creation.
    adjacent: Vec<Vec<RelationId>>,
    /// What happened since the journal was last taken.
    journal: Vec<Change>,
}

impl Manifold {
    /// An empty map.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes a robot into the team.
    pub fn add_robot(&mut self, name: &str) -> RobotId {
        let id = RobotId(self.robots.len() as u16);
        self.record(Change::RobotJoined(Robot { id, name: Arc::from(name) }));
        id
    }

    /// Adds a patch without relations, under the next free id whatever id it has: the start of an
    /// island, until it is related.
    pub fn add_patch(&mut self, patch: Patch) -> PatchId {
        let id = PatchId(self.patches.len() as u32);
        self.record(Change::PatchAdded(Patch { id, ..patch }));
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
        self.add_relation(from, to, from_from_to, provenance, RelationState::Active)
    }

    /// Puts a relation on record that is no part of the map until it is confirmed.
    pub fn propose(
        &mut self,
        from: PatchId,
        to: PatchId,
        from_from_to: GaussianPose2,
        provenance: Provenance,
    ) -> RelationId {
        self.add_relation(from, to, from_from_to, provenance, RelationState::Provisional)
    }

    /// Makes a proposed or retracted relation part of the map.
    pub fn confirm(&mut self, id: RelationId) {
        if !self.relation(id).is_active() {
            self.record(Change::RelationConfirmed(id));
        }
    }

    /// Takes a relation back. It stays on record but is no longer part of the map; the first reason
    /// given stands.
    pub fn retract(&mut self, id: RelationId, reason: Retraction) {
        if !matches!(self.relation(id).state, RelationState::Retracted(_)) {
            self.record(Change::RelationRetracted(id, reason));
        }
    }

    /// Re-estimates poses: where each named patch now lies in its island.
    pub fn refit(&mut self, poses: Vec<(PatchId, Pose2)>) {
        if !poses.is_empty() {
            self.record(Change::PosesReestimated(poses));
        }
    }

    /// Re-estimates heights.
    pub fn elevate(&mut self, elevations: Vec<(PatchId, Elevation)>) {
        if !elevations.is_empty() {
            self.record(Change::ElevationsReestimated(elevations));
        }
    }

    /// Notes what a robot measured between two patches.
    pub fn note_way(&mut self, way: Way) {
        self.record(Change::WayNoted(way));
    }

    /// Stores a landmark seen from a patch.
    pub fn note_sighting(&mut self, sighting: PatchSighting) {
        self.record(Change::LandmarkSighted(sighting));
    }

    /// Leaves patches out of the map, or takes them in again.
    pub fn leave_out(&mut self, patches: Vec<PatchId>, left_out: bool) {
        if !patches.is_empty() {
            self.record(Change::LeftOut(patches, left_out));
        }
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
        let related = |r: RelationId| r.index() < self.relations.len();
        let follows = match change {
            Change::RobotJoined(robot) => usize::from(robot.id.0) == self.robots.len(),
            Change::PatchAdded(patch) => patch.id.index() == self.patches.len(),
            Change::RelationAdded(r) => {
                r.id.index() == self.relations.len()
                    && known(r.from)
                    && known(r.to)
                    && r.from != r.to
            }
            Change::RelationConfirmed(id) => related(*id),
            Change::RelationRetracted(id, _) => related(*id),
            Change::PosesReestimated(poses) => poses.iter().all(|p| known(p.0)),
            Change::ElevationsReestimated(heights) => heights.iter().all(|h| known(h.0)),
            Change::WayNoted(way) => known(way.from) && known(way.to),
            Change::LandmarkSighted(sighting) => known(sighting.patch),
            Change::LeftOut(patches, _) => patches.iter().all(|p| known(*p)),
        };
        if !follows {
            return Err(ManifoldError::OutOfOrder);
        }
        self.record(change.clone());
        Ok(())
    }

    /// The robots in the order of joining.
    pub fn robots(&self) -> &[Robot] {
        &self.robots
    }

    /// All patches in order of creation.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// One patch.
    pub fn patch(&self, id: PatchId) -> &Patch {
        &self.patches[id.index()]
    }

    /// True when two patches of an island certainly lie on different levels. Unknown heights tell
    /// nothing.
    pub fn apart_in_height(&self, a: PatchId, b: PatchId) -> bool {
        let heights = self.patch(a).elevation.zip(self.patch(b).elevation);
        heights.is_some_and(|(a, b)| a.is_apart_from(&b))
    }

    /// All relations on record in order of creation, those that are no part of the map included.
    pub fn relations(&self) -> &[Relation] {
        &self.relations
    }

    /// One relation.
    pub fn relation(&self, id: RelationId) -> &Relation {
        &self.relations[id.index()]
    }

    /// The relations that are part of the map.
    pub fn active_relations(&self) -> impl Iterator<Item = &Relation> {
        self.relations.iter().filter(|r| r.is_active())
    }

    /// What robots measured between their patches, in the order it was noted.
    pub fn ways(&self) -> &[Way] {
        &self.ways
    }

    /// Landmarks seen, in the order they were noted.
    pub fn sightings(&self) -> &[PatchSighting] {
        &self.sightings
    }

    /// The neighbours of a patch: the other end and `patch_from_other`.
    pub fn neighbours(&self, id: PatchId) -> impl Iterator<Item = (PatchId, GaussianPose2)> + '_ {
        self.adjacent[id.index()]
            .iter()
            .filter_map(move |r| self.relations[r.index()].seen_from(id))
    }

    /// The relations at a patch that are part of the map, in order of creation.
    pub fn relations_at(&self, id: PatchId) -> impl Iterator<Item = &Relation> {
        self.adjacent[id.index()].iter().map(|r| &self.relations[r.index()])
    }

    fn add_relation(
        &mut self,
        from: PatchId,
        to: PatchId,
        from_from_to: GaussianPose2,
        provenance: Provenance,
        state: RelationState,
    ) -> RelationId {
        let id = RelationId(self.relations.len() as u32);
        self.record(Change::RelationAdded(Relation {
            id,
            from,
            to,
            from_from_to,
            provenance,
            state,
        }));
        id
    }

    /// Performs a change that follows on the present state, and writes it down.
    fn record(&mut self, change: Change) {
        match &change {
            Change::RobotJoined(robot) => self.robots.push(robot.clone()),
            Change::PatchAdded(patch) => {
                self.patches.push(patch.clone());
                self.adjacent.push(Vec::new());
            }
            Change::RelationAdded(relation) => {
                self.relations.push(*relation);
                self.attach(relation.id, relation.is_active());
            }
            Change::RelationConfirmed(id) => {
                self.relations[id.index()].state = RelationState::Active;
                self.attach(*id, true);
            }
            Change::RelationRetracted(id, reason) => {
                self.relations[id.index()].state = RelationState::Retracted(*reason);
                self.attach(*id, false);
            }
            Change::PosesReestimated(poses) => {
                for &(patch, pose) in poses {
                    self.patches[patch.index()].island_from_patch = pose;
                }
            }
            Change::ElevationsReestimated(elevations) => {
                for &(patch, elevation) in elevations {
                    self.patches[patch.index()].elevation = Some(elevation);
                }
            }
            Change::WayNoted(way) => self.ways.push(*way),
            Change::LandmarkSighted(sighting) => self.sightings.push(sighting.clone()),
            Change::LeftOut(patches, left_out) => {
                for patch in patches {
                    self.patches[patch.index()].left_out = *left_out;
                }
            }
        }
        self.journal.push(change);
    }

    /// Lists a relation at its ends, or does so no longer; the lists stay in order of creation.
    fn attach(&mut self, id: RelationId, attached: bool) {
        let relation = self.relations[id.index()];
        for end in [relation.from, relation.to] {
            let list = &mut self.adjacent[end.index()];
            match (list.binary_search(&id), attached) {
                (Err(place), true) => list.insert(place, id),
                (Ok(place), false) => {
                    list.remove(place);
                }
                _ => {}
            }
        }
    }
}
