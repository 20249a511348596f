//! What the user has taken back is not found again.

use super::Closure;
use crate::map::Map;
use geometry::Pose2;
use manifold::{PatchId, Relation, RelationState, Retraction};

/// Ends of closures within this distance of each other are at the same place, metres.
const SAME_PLACE_M: f64 = 3.0;
/// Closures that place the one end this near seen from the other say the same, metres.
const SAME_POSE_M: f64 = 1.0;

/// True where the user has taken back a relation that says the same of the same places.
pub(super) fn taken_back(map: &Map, closure: &Closure) -> bool {
    let by_user = RelationState::Retracted(Retraction::ByUser);
    let retracted = map.manifold.relations().iter().filter(|r| r.state == by_user);
    let mut seen_from_either_end = retracted.flat_map(|r| {
        let Relation { from, to, from_from_to, .. } = *r;
        [(from, to, from_from_to.mean), (to, from, from_from_to.mean.inverse())]
    });
    seen_from_either_end.any(|(from, to, from_from_to)| {
        let Some(from_from_from) = step(map, from, closure.from) else { return false };
        let Some(to_from_to) = step(map, closure.to, to) else { return false };
        let claimed = from_from_from * closure.result.pose * to_from_to;
        claimed.distance(&from_from_to) < SAME_POSE_M
    })
}

/// The pose of a patch seen from another one of the same robot at the same place.
fn step(map: &Map, from: PatchId, to: PatchId) -> Option<Pose2> {
    let robot = |patch: PatchId| map.manifold.patch(patch).robot;
    let step = map.pose(from).between(&map.pose(to));
    (robot(from) == robot(to) && step.norm() < SAME_PLACE_M).then_some(step)
}
