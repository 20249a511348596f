use crate::{
    Elevation, Patch, PatchId, PatchSighting, Relation, RelationId, Retraction, Robot, Way,
};
use geometry::Pose2;

/// Something that happened to a manifold: what is stored, sent and drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// A robot joined the team.
    RobotJoined(Robot),
    /// A patch was added.
    PatchAdded(Patch),
    /// Two patches were related, or a relation was proposed: its state tells.
    RelationAdded(Relation),
    /// A proposed or retracted relation became part of the map.
    RelationConfirmed(RelationId),
    /// A relation was taken back.
    RelationRetracted(RelationId, Retraction),
    /// Patches were moved within their islands: `island_from_patch`.
    PosesReestimated(Vec<(PatchId, Pose2)>),
    /// Patches' heights were estimated.
    ElevationsReestimated(Vec<(PatchId, Elevation)>),
    /// What a robot measured on the way between two patches.
    WayNoted(Way),
    /// A landmark was seen from a patch.
    LandmarkSighted(PatchSighting),
    /// Patches were left out of the map (true) or taken in again.
    LeftOut(Vec<PatchId>, bool),
}

/// Why a change could not be applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ManifoldError {
    /// The change names a robot, patch or relation that does not exist here, or adds one out of
    /// turn.
    #[error("the change does not follow on this manifold's state")]
    OutOfOrder,
}
