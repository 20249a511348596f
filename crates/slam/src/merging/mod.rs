//! Joining islands where evidence says how they lie to each other (thesis 5.4.4).

mod landmarks;

pub(crate) use landmarks::{
    GATE_CHI2, carried, point_jacobian, propose_by_landmarks, revisit, turned,
};
pub use landmarks::{
    IslandLandmark, IslandLandmarks, LandmarkAlignment, LandmarkRefit, LandmarkSettings,
    compare_landmarks,
};

use crate::map::Map;
use geometry::{GaussianPose2, Pose2};
use manifold::{Islands, PatchId, Provenance};
use serde::{Deserialize, Serialize};

/// Joining islands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MergingSettings {
    /// Look for merges.
    pub enabled: bool,
    /// Islands are joined only when the chance that this is wrong is bounded by so much; what falls
    /// short is put on record as provisional.
    pub false_merges: f64,
    /// Joining them by landmarks, and closing loops by them.
    pub landmarks: LandmarkSettings,
}

impl Default for MergingSettings {
    fn default() -> Self {
        MergingSettings { enabled: true, false_merges: 1e-4, landmarks: LandmarkSettings::default() }
    }
}

/// A way in which two islands may lie to each other, with what speaks for it.
#[derive(Clone, Debug)]
pub(crate) struct Proposal {
    /// The source island's frame seen from the target's.
    pub target_from_source: Pose2,
    /// Relations from patches of the target to patches of the source; never empty.
    pub links: Vec<Link>,
    /// Bound on the chance that the proposal is wrong.
    pub false_bound: f64,
}

/// A relation between two islands that is not made yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// Patch of the target island.
    pub from: PatchId,
    /// Patch of the source island.
    pub to: PatchId,
    pub from_from_to: GaussianPose2,
    pub provenance: Provenance,
}

impl Proposal {
    /// The indices of the two islands, target first.
    pub fn ends(&self, islands: &Islands) -> Option<(usize, usize)> {
        let link = self.links.first()?;
        Some((islands.of(link.from), islands.of(link.to)))
    }
}

/// Joins two islands: the source is moved as a rigid body into the target's frame and the links
/// become relations. The poses are not optimised yet.
pub(crate) fn join(map: &mut Map, islands: &Islands, proposal: &Proposal) {
    let Some((target, source)) = proposal.ends(islands) else { return };
    if target != source {
        let moved = |&patch: &PatchId| (patch, proposal.target_from_source * map.pose(patch));
        let poses = islands.members[source].iter().map(moved).collect();
        map.manifold.refit(poses);
    }
    for link in &proposal.links {
        map.manifold.relate(link.from, link.to, link.from_from_to, link.provenance);
    }
}
