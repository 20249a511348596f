use geometry::Pose2;
use manifold::{Manifold, PatchId};
use matching::LinePoint;

/// The manifold with what the pipeline derives from its scans and remembers of its making.
#[derive(Clone, Debug, Default)]
pub(crate) struct Map {
    pub manifold: Manifold,
    /// Line points of every patch, in the patch's frame.
    pub surfaces: Vec<Vec<LinePoint>>,
}

impl Map {
    /// Present pose of a patch in its island.
    pub fn pose(&self, patch: PatchId) -> Pose2 {
        self.manifold.patch(patch).island_from_patch
    }

    /// Line points of a patch.
    pub fn surface(&self, patch: PatchId) -> &[LinePoint] {
        &self.surfaces[patch.index()]
    }

    /// Sets the line points of a patch.
    pub fn set_surface(&mut self, patch: PatchId, surface: Vec<LinePoint>) {
        if self.surfaces.len() <= patch.index() {
            self.surfaces.resize(patch.index() + 1, Vec::new());
        }
        self.surfaces[patch.index()] = surface;
    }
}
