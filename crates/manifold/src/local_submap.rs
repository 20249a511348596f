use crate::{Manifold, PatchId};
use geometry::GaussianPose2;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};

/// Half width of a 95 % interval in standard deviations (thesis 5.3.3).
pub const INTERVAL_95: f64 = 1.96;

/// What belongs to a local submap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubmapLimits {
    /// Largest 95 % interval of a member's position along either axis, metres.
    pub translation_m: f64,
    /// Largest 95 % interval of a member's yaw, radians.
    pub rotation_rad: f64,
    /// Members lie within this distance of the start, metres.
    pub distance_m: f64,
    /// At most this many members, the nearest along the graph.
    pub patches: usize,
}

impl Default for SubmapLimits {
    fn default() -> Self {
        SubmapLimits { translation_m: 0.3, rotation_rad: 0.1, distance_m: 12.0, patches: 60 }
    }
}

/// A patch of a local submap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubmapMember {
    /// The patch.
    pub patch: PatchId,
    /// Its pose seen from the start, composed along the path of the search.
    pub start_from_patch: GaussianPose2,
    /// Number of relations on that path.
    pub steps: usize,
}

impl Manifold {
    /// All well-fitted patches around `start`, itself first: breadth-first search that goes on only
    /// from patches whose 95 % intervals are within the limits (algorithm 5.1 with the uncertainty
    /// composed along the path, see docs/math/path-uncertainty.md). Patches of other levels are
    /// left out.
    pub fn local_submap(&self, start: PatchId, limits: &SubmapLimits) -> Vec<SubmapMember> {
        let origin = GaussianPose2::exact(geometry::Pose2::IDENTITY);
        let first = SubmapMember { patch: start, start_from_patch: origin, steps: 0 };
        let mut members = vec![first];
        let mut seen = BTreeMap::from([(start, ())]);
        let mut frontier = VecDeque::from([first]);
        while let Some(member) = frontier.pop_front() {
            for (other, step) in self.neighbours(member.patch) {
                if members.len() >= limits.patches {
                    return members;
                }
                let start_from_patch = member.start_from_patch.compose(&step);
                if seen.contains_key(&other)
                    || !limits.admit(&start_from_patch)
                    || self.apart_in_height(start, other)
                {
                    continue;
                }
                seen.insert(other, ());
                let next = SubmapMember { patch: other, start_from_patch, steps: member.steps + 1 };
                members.push(next);
                frontier.push_back(next);
            }
        }
        members
    }
}

impl SubmapLimits {
    /// True when a pose is near and known well enough to be in the submap.
    pub fn admit(&self, pose: &GaussianPose2) -> bool {
        let interval = |i: usize| INTERVAL_95 * pose.covariance[(i, i)].max(0.0).sqrt();
        pose.mean.norm() <= self.distance_m
            && interval(0) <= self.translation_m
            && interval(1) <= self.translation_m
            && interval(2) <= self.rotation_rad
    }
}
