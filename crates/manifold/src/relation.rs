use crate::PatchId;
use geometry::{GaussianPose2, Pose2};
use serde::{Deserialize, Serialize};

/// Name of a relation: its index in the manifold, in the order of creation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct RelationId(pub u32);

impl RelationId {
    /// The id as an index.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Where a relation comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Provenance {
    /// The robot drove from one patch to the other.
    Sequential,
    /// A loop closed by comparing geometry.
    LoopClosure,
    /// A loop closed, or islands merged, where both ends see the same landmarks.
    Landmark,
    /// Islands merged by comparing geometry.
    Merge,
    /// One robot saw the other.
    Rendezvous,
}

/// Whether a relation is part of the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RelationState {
    /// Part of the map.
    #[default]
    Active,
    /// Proposed: its evidence is not enough yet. On record, but no part of the map.
    Provisional,
    /// Taken back: kept for the record, but no longer part of the map.
    Retracted(Retraction),
}

/// Why a relation was taken back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Retraction {
    /// Other relations contradict it.
    Contradicted,
    /// The user said so; nothing like it is proposed again between the two ends' robots.
    ByUser,
    /// The robot's data went bad at that point.
    BadData,
}

/// An edge of the manifold: a relative pose with its uncertainty (a constraint, elsewhere).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Name.
    pub id: RelationId,
    /// The patch the pose is seen from.
    pub from: PatchId,
    /// The patch that is seen.
    pub to: PatchId,
    /// `from_from_to` with covariance in the frame of `to`.
    pub from_from_to: GaussianPose2,
    /// Where it comes from.
    pub provenance: Provenance,
    /// Whether it is part of the map.
    pub state: RelationState,
}

impl Relation {
    /// True when it is part of the map.
    pub fn is_active(&self) -> bool {
        self.state == RelationState::Active
    }

    /// The relation seen from `patch`: the patch at the other end and `patch_from_other`; `None` if
    /// `patch` is not one of its ends.
    pub fn seen_from(&self, patch: PatchId) -> Option<(PatchId, GaussianPose2)> {
        if patch == self.from {
            Some((self.to, self.from_from_to))
        } else if patch == self.to {
            Some((self.from, self.from_from_to.inverse()))
        } else {
            None
        }
    }
}

/// The pose `b_from_robot` of a robot at `a_from_robot`, through the relation between patches `a`
/// and `b` and not by way of the island's frame: the thesis's operator for use while refits are
/// pending (5.5).
///
/// `None` if `a` is not an end of the relation.
pub fn through_relation(
    a_from_robot: &GaussianPose2,
    a: PatchId,
    relation: &Relation,
) -> Option<(PatchId, GaussianPose2)> {
    let (b, a_from_b) = relation.seen_from(a)?;
    Some((b, a_from_b.inverse().compose(a_from_robot)))
}

/// A convenience for [`through_relation`] where only the mean matters.
impl Relation {
    /// `other_from_robot`, given `patch_from_robot`.
    pub fn carry(&self, patch: PatchId, patch_from_robot: &Pose2) -> Option<(PatchId, Pose2)> {
        let (other, patch_from_other) = self.seen_from(patch)?;
        Some((other, patch_from_other.mean.inverse() * *patch_from_robot))
    }
}
