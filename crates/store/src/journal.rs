//! Changes as journal rows, and back.

use crate::cells::Cells;
use crate::rows::{
    patch_cells, read_patch, read_relation, read_robot, read_sighting, read_way, relation_cells,
    retraction, retraction_name, robot_cells, sighting_cells, way_cells,
};
use geometry::Pose2;
use manifold::{Change, Elevation, PatchId, RelationId};
use sensing::Scan;
use std::collections::BTreeMap;
use std::sync::Arc;

const ROBOT: &str = "robot-joined";
const PATCH: &str = "patch-added";
const RELATION: &str = "relation-added";
const CONFIRMED: &str = "relation-confirmed";
const RETRACTED: &str = "relation-retracted";
const POSES: &str = "poses-reestimated";
const ELEVATIONS: &str = "elevations-reestimated";
const WAY: &str = "way-noted";
const SIGHTING: &str = "landmark-sighted";
const LEFT_OUT: &str = "left-out";

/// A change as its kind and the values it carries. A patch's scan stands in a table of its own; the
/// journal names that row's checksum.
pub(crate) fn write(change: &Change, scan_checksum: Option<u64>) -> (&'static str, Cells) {
    let cells = Cells::default();
    match change {
        Change::RobotJoined(robot) => (ROBOT, robot_cells(robot)),
        Change::PatchAdded(patch) => {
            (PATCH, patch_cells(patch, patch.id).bits(scan_checksum.unwrap_or_default()))
        }
        Change::RelationAdded(relation) => (RELATION, relation_cells(relation)),
        Change::RelationConfirmed(id) => (CONFIRMED, cells.int(id.0)),
        Change::RelationRetracted(id, reason) => {
            (RETRACTED, cells.int(id.0).text(retraction_name(*reason)))
        }
        Change::PosesReestimated(poses) => {
            let write = |c: Cells, (id, p): &(PatchId, Pose2)| c.int(id.0).reals([p.x, p.y, p.yaw]);
            (POSES, poses.iter().fold(cells, write))
        }
        Change::ElevationsReestimated(elevations) => {
            let write = |c: Cells, (id, e): &(PatchId, Elevation)| {
                c.int(id.0).reals([e.height_m, e.variance_m2])
            };
            (ELEVATIONS, elevations.iter().fold(cells, write))
        }
        Change::WayNoted(way) => (WAY, way_cells(0, way)),
        Change::LandmarkSighted(sighting) => (SIGHTING, sighting_cells(0, sighting)),
        Change::LeftOut(patches, left_out) => {
            (LEFT_OUT, patches.iter().fold(cells.int(*left_out), |c, patch| c.int(patch.0)))
        }
    }
}

/// The change that a journal row tells; `None` when it tells none.
///
/// `scan` hands out a patch's scan, given the checksum that its row must have.
pub(crate) fn read(
    kind: &str,
    payload: &[u8],
    scan: impl FnOnce(PatchId, u64) -> Option<Arc<Scan>>,
) -> Option<Change> {
    let cells = Cells::from_bytes(payload)?;
    let width = match kind {
        POSES => 4,
        ELEVATIONS => 3,
        _ => 1,
    };
    let count = cells.0.len() / width;
    if count * width != cells.0.len() {
        return None;
    }
    let checksum = match cells.0.last() {
        Some(rusqlite::types::Value::Integer(bits)) => *bits as u64,
        _ => 0,
    };
    let mut row = cells.reader();
    let change = match kind {
        ROBOT => return read_robot(row).map(Change::RobotJoined),
        RELATION => return read_relation(row).map(Change::RelationAdded),
        WAY => return read_way(row).map(|(_, way)| Change::WayNoted(way)),
        SIGHTING => return read_sighting(row).map(|(_, seen)| Change::LandmarkSighted(seen)),
        PATCH => {
            let (patch, _) = read_patch(&mut row, |id| scan(id, checksum))?;
            row.bits()?;
            Change::PatchAdded(patch)
        }
        CONFIRMED => Change::RelationConfirmed(RelationId(row.int()?)),
        RETRACTED => Change::RelationRetracted(RelationId(row.int()?), retraction(&row.text()?)?),
        POSES => {
            let mut one = |_| {
                let (id, [x, y, yaw]) = (PatchId(row.int()?), row.reals()?);
                Some((id, Pose2 { x, y, yaw }))
            };
            Change::PosesReestimated((0..count).map(&mut one).collect::<Option<_>>()?)
        }
        ELEVATIONS => {
            let mut one = |_| {
                let (id, [height_m, variance_m2]) = (PatchId(row.int()?), row.reals()?);
                Some((id, Elevation { height_m, variance_m2 }))
            };
            Change::ElevationsReestimated((0..count).map(&mut one).collect::<Option<_>>()?)
        }
        LEFT_OUT => {
            let left_out = row.flag()?;
            let patches = (1..count).map(|_| row.int().map(PatchId)).collect::<Option<_>>()?;
            Change::LeftOut(patches, left_out)
        }
        _ => return None,
    };
    row.end().map(|()| change)
}

/// The same changes with the re-estimations of poses folded into one, at the end: only the last
/// pose of every patch counts, and no other change depends on poses.
pub(crate) fn fold(changes: &[Change]) -> Vec<Change> {
    let mut poses = BTreeMap::new();
    let mut folded = Vec::with_capacity(changes.len());
    for change in changes {
        match change {
            Change::PosesReestimated(moved) => poses.extend(moved.iter().copied()),
            other => folded.push(other.clone()),
        }
    }
    if !poses.is_empty() {
        folded.push(Change::PosesReestimated(poses.into_iter().collect()));
    }
    folded
}
