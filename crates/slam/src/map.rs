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

    /// True when two patches of an island certainly lie on different levels: nothing may close, fit
    /// or be looked up between them. Unknown heights tell nothing.
    pub fn apart_in_height(&self, a: PatchId, b: PatchId) -> bool {
        self.manifold.apart_in_height(a, b)
    }

    /// Line points of a patch.
    pub fn surface(&self, patch: PatchId) -> &[LinePoint] {
        &self.surfaces[patch.index()]
    }
}
