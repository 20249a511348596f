use crate::{Patch, PatchId, Relation, RelationId};
use geometry::Pose2;

/// Something that happened to a manifold: what is stored, sent and drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// A patch was added.
    PatchAdded(Patch),
    /// Two patches were related.
    RelationAdded(Relation),
    /// A relation was taken back.
    RelationRetracted(RelationId),
    /// Patches were moved within their islands: `island_from_patch`.
    PosesReestimated(Vec<(PatchId, Pose2)>),
}

/// Why a change could not be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ManifoldError {
    /// The change names a patch or relation that does not exist here, or adds one out of turn.
    #[error("the change does not follow on this manifold's state")]
    OutOfOrder,
}
