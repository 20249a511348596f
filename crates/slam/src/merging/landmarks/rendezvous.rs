use super::island::IslandLandmark;
use crate::track::ScanRecord;
use geometry::{LieGroup, Matrix2, Pose2};
use manifold::{Islands, Manifold, PatchSighting};
use sensing::{LandmarkKind, RobotId, Stamp};
use std::collections::{BTreeMap, BTreeSet};

/// Most meetings of one robot with another, evenly spread.
const MOST_MEETINGS: usize = 40;
/// Between scans farther apart in time nobody knows where a robot was, seconds.
const LONGEST_GAP_SECS: f64 = 2.0;
/// How well a robot's place on its own patch is known, metres and radians: that of a match.
const PLACE_STD_M: f64 = 0.03;
const TURN_STD_RAD: f64 = 0.02;
/// Error of a place between two scans, share of the way between them.
const BETWEEN: f64 = 0.25;

/// Robots that saw each other: each meeting is a landmark of its own, on the island of the one that
/// saw and on that of the one that was seen, where it was at that time.
///
/// Needs clocks that agree. The robots' scans are given in the order of the robots.
pub(crate) fn meetings(
    manifold: &Manifold,
    islands: &Islands,
    tracks: &[&[ScanRecord]],
) -> Vec<(usize, IslandLandmark)> {
    let names: BTreeMap<&str, RobotId> =
        manifold.robots().iter().map(|r| (&*r.name, r.id)).collect();
    let mut seen: BTreeMap<(RobotId, RobotId), Vec<Meeting>> = BTreeMap::new();
    let mut counted = BTreeSet::new();
    for sighting in manifold.sightings().iter().filter(|s| s.sighting.kind == LandmarkKind::Robot) {
        let from = manifold.patch(sighting.patch);
        let named = sighting.sighting.id.as_deref().and_then(|id| names.get(id));
        let Some(&other) = named.filter(|other| **other != from.robot && !from.left_out) else {
            continue;
        };
        let Some(track) = tracks.get(usize::from(other.0)) else { continue };
        let Some(place) = place_at(manifold, track, sighting.stamp) else { continue };
        if counted.insert((sighting.patch, place.patch)) {
            seen.entry((from.robot, other)).or_default().push(Meeting { sighting, place });
        }
    }
    let mut landmarks = Vec::new();
    for ((_, other), all) in seen {
        let step = all.len().div_ceil(MOST_MEETINGS).max(1);
        for meeting in all.iter().step_by(step) {
            let both = meeting.landmarks(manifold, islands, other);
            if both[0].0 != both[1].0 {
                landmarks.extend(both);
            }
        }
    }
    landmarks
}

/// One robot sees another.
struct Meeting<'a> {
    sighting: &'a PatchSighting,
    place: Place,
}

/// Where a robot was at some time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    patch: manifold::PatchId,
    patch_from_robot: Pose2,
    variance_m2: f64,
    variance_rad2: f64,
}

impl Meeting<'_> {
    /// The same landmark on both islands.
    fn landmarks(
        &self,
        manifold: &Manifold,
        islands: &Islands,
        other: RobotId,
    ) -> [(usize, IslandLandmark); 2] {
        let (patch, seen) = (self.sighting.patch, &self.sighting.sighting);
        let robot = manifold.patch(patch).robot;
        let id = format!("{} by {} at {}", other.0, robot.0, self.sighting.stamp.0);
        let of_seer = IslandLandmark {
            kind: LandmarkKind::Robot,
            id: Some(id.into()),
            patch,
            island_from_patch: manifold.patch(patch).island_from_patch,
            position: seen.position,
            covariance: seen.covariance,
            yaw: seen.yaw,
            sightings: 1,
            robots: vec![robot],
        };
        let place = &self.place;
        let of_seen = IslandLandmark {
            patch: place.patch,
            island_from_patch: manifold.patch(place.patch).island_from_patch,
            position: place.patch_from_robot.translation(),
            covariance: Matrix2::identity() * place.variance_m2,
            yaw: seen.yaw.map(|_| (place.patch_from_robot.yaw, place.variance_rad2)),
            ..of_seer.clone()
        };
        [(islands.of(patch), of_seer), (islands.of(place.patch), of_seen)]
    }
}

/// Where a robot was at a time, between the two scans of its log around it.
fn place_at(manifold: &Manifold, track: &[ScanRecord], stamp: Stamp) -> Option<Place> {
    let around = track.windows(2).find(|w| w[0].stamp <= stamp && stamp <= w[1].stamp)?;
    let gap = around[1].stamp.secs_since(around[0].stamp);
    if gap > LONGEST_GAP_SECS || manifold.patch(around[0].pose.patch).left_out {
        return None;
    }
    let [before, after] = [0, 1].map(|i| around[i].pose.in_map(manifold));
    let share = if gap > 0.0 { stamp.secs_since(around[0].stamp) / gap } else { 0.0 };
    let step = before.between(&after).log();
    let (way, turn) = (step.xy().norm() * BETWEEN, step.z.abs() * BETWEEN);
    Some(Place {
        patch: around[0].pose.patch,
        patch_from_robot: around[0].pose.patch_from_base * Pose2::exp(&(step * share)),
        variance_m2: PLACE_STD_M * PLACE_STD_M + way * way,
        variance_rad2: TURN_STD_RAD * TURN_STD_RAD + turn * turn,
    })
}
