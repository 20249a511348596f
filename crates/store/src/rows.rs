//! What the tables' rows say: from the map's types to columns and back.

use crate::cells::{CellReader, Cells};
use crate::observations::ObservationBlock;
use crate::schema::WITH_OBSERVATIONS;
use crate::site::{RobotLog, StepSummary, TrackedScan};
use crate::table::Table;
use geometry::{GaussianPose2, Matrix2, Matrix3, Pose2, Vector2};
use manifold::{
    Climb, Elevation, Patch, PatchId, PatchSighting, Provenance, Relation, RelationId,
    RelationState, Retraction, Robot, Way,
};
use sensing::{Attitude, LandmarkKind, RobotId, Scan, Sighting, Stamp, Sweep, Twist};
use std::sync::Arc;

pub(crate) const VERSIONS: Table =
    Table { name: "versions", key: 1, columns: &["version", "program"] };
pub(crate) const METADATA: Table = Table { name: "metadata", key: 1, columns: &["key", "value"] };
pub(crate) const ROBOTS: Table = Table { name: "robots", key: 1, columns: &["robot", "name"] };
pub(crate) const LOGS: Table = Table {
    name: "logs",
    key: 1,
    columns: &["robot", "name", "file", "content_hash", "joined_unix_ns", "reader_report"],
};
#[rustfmt::skip]
pub(crate) const PATCHES: Table = Table {
    name: "patches",
    key: 1,
    columns: &[
        "patch", "robot", "stamp_ns", "island", "x_m", "y_m", "yaw_rad", "height_m",
        "height_variance_m2", "left_out", "laser_x_m", "laser_y_m", "laser_yaw_rad", "roll_rad",
        "pitch_rad", "forward_m_per_sec", "turning_rad_per_sec", "sweep_secs", "sweep_reference",
    ],
};
pub(crate) const SCANS: Table =
    Table { name: "scans", key: 1, columns: &["patch", "beams", "data"] };
#[rustfmt::skip]
pub(crate) const RELATIONS: Table = Table {
    name: "relations",
    key: 1,
    columns: &[
        "relation", "from_patch", "to_patch", "provenance", "state", "retraction", "x_m", "y_m",
        "yaw_rad", "c_xx", "c_xy", "c_xw", "c_yx", "c_yy", "c_yw", "c_wx", "c_wy", "c_ww",
    ],
};
#[rustfmt::skip]
pub(crate) const WAYS: Table = Table {
    name: "ways",
    key: 1,
    columns: &[
        "way", "from_patch", "to_patch", "x_m", "y_m", "yaw_rad", "c_xx", "c_xy", "c_xw", "c_yx",
        "c_yy", "c_yw", "c_wx", "c_wy", "c_ww", "rise_m", "distance_m", "rise_variance_m2",
    ],
};
#[rustfmt::skip]
pub(crate) const SIGHTINGS: Table = Table {
    name: "sightings",
    key: 1,
    columns: &[
        "sighting", "patch", "stamp_ns", "kind", "landmark", "x_m", "y_m", "c_xx", "c_xy", "c_yx",
        "c_yy", "yaw_rad", "yaw_variance_rad2",
    ],
};
#[rustfmt::skip]
pub(crate) const TRAJECTORY: Table = Table {
    name: "trajectory",
    key: 2,
    columns: &[
        "robot", "scan", "stamp", "stamp_ns", "patch", "x_m", "y_m", "yaw_rad", "odom_x_m",
        "odom_y_m", "odom_yaw_rad",
    ],
};
pub(crate) const OBSERVATIONS: Table = Table {
    name: "observations",
    key: 1,
    columns: &["block", "robot", "first_scan", "scans", "data"],
};
pub(crate) const STEPS: Table = Table {
    name: "steps",
    key: 1,
    columns: &["step", "time_unix_ns", "note", "first_change", "changes", "scans"],
};
/// All tables of the state, in the order in which they are read.
pub(crate) const STATE: [Table; 12] = [
    VERSIONS,
    METADATA,
    ROBOTS,
    LOGS,
    SCANS,
    PATCHES,
    RELATIONS,
    WAYS,
    SIGHTINGS,
    TRAJECTORY,
    STEPS,
    OBSERVATIONS,
];

/// The tables of a schema version.
pub(crate) fn state_of(version: i64) -> &'static [Table] {
    let newer = usize::from(version < WITH_OBSERVATIONS);
    &STATE[..STATE.len() - newer]
}

pub(crate) fn coordinates(pose: &Pose2) -> [f64; 3] {
    [pose.x, pose.y, pose.yaw]
}

/// No wrapping: the bits are those that were stored.
pub(crate) fn pose([x, y, yaw]: [f64; 3]) -> Pose2 {
    Pose2 { x, y, yaw }
}

pub(crate) fn attitude_numbers(a: Attitude) -> [f64; 2] {
    [a.roll_rad, a.pitch_rad]
}

pub(crate) fn attitude([roll_rad, pitch_rad]: [f64; 2]) -> Attitude {
    Attitude { roll_rad, pitch_rad }
}

pub(crate) fn sweep_numbers(s: Sweep) -> [f64; 4] {
    [s.twist.forward_m_per_sec, s.twist.yaw_rad_per_sec, s.duration_secs, s.reference]
}

pub(crate) fn sweep(
    [forward_m_per_sec, yaw_rad_per_sec, duration_secs, reference]: [f64; 4],
) -> Sweep {
    Sweep { twist: Twist { forward_m_per_sec, yaw_rad_per_sec }, duration_secs, reference }
}

/// Mean, then the covariance row by row.
fn gaussian(value: &GaussianPose2) -> [f64; 12] {
    let c = &value.covariance;
    let mut numbers = [0.0; 12];
    numbers[..3].copy_from_slice(&coordinates(&value.mean));
    (0..9).for_each(|i| numbers[3 + i] = c[(i / 3, i % 3)]);
    numbers
}

fn read_gaussian(numbers: [f64; 12]) -> GaussianPose2 {
    GaussianPose2 {
        mean: Pose2 { x: numbers[0], y: numbers[1], yaw: numbers[2] },
        covariance: Matrix3::from_row_slice(&numbers[3..]),
    }
}

pub(crate) fn version_cells(version: i64, program: &str) -> Cells {
    Cells::default().int(version).text(program)
}

pub(crate) fn read_version(mut row: CellReader) -> Option<(i64, String)> {
    let entry = (row.int()?, row.text()?);
    row.end().map(|()| entry)
}

pub(crate) fn metadata_cells(key: &str, value: &str) -> Cells {
    Cells::default().text(key).text(value)
}

pub(crate) fn read_metadata(mut row: CellReader) -> Option<(String, String)> {
    let entry = (row.text()?, row.text()?);
    row.end().map(|()| entry)
}

pub(crate) fn robot_cells(robot: &Robot) -> Cells {
    Cells::default().int(robot.id.0).text(&robot.name)
}

pub(crate) fn read_robot(mut row: CellReader) -> Option<Robot> {
    let robot = Robot { id: RobotId(row.int()?), name: Arc::from(row.text()?) };
    row.end().map(|()| robot)
}

pub(crate) fn log_cells(log: &RobotLog) -> Cells {
    Cells::default()
        .int(log.robot.0)
        .text(&log.name)
        .text(&log.file)
        .text(&log.content_hash)
        .int(log.joined_unix_ns)
        .text(&log.reader_report)
}

pub(crate) fn read_log(mut row: CellReader) -> Option<RobotLog> {
    let log = RobotLog {
        robot: RobotId(row.int()?),
        name: row.text()?,
        file: row.text()?,
        content_hash: row.text()?,
        joined_unix_ns: row.int()?,
        reader_report: row.text()?,
    };
    row.end().map(|()| log)
}

/// A patch without its scan; `island` is the first patch of its island.
pub(crate) fn patch_cells(patch: &Patch, island: PatchId) -> Cells {
    Cells::default()
        .int(patch.id.0)
        .int(patch.robot.0)
        .int(patch.stamp.0)
        .int(island.0)
        .reals(coordinates(&patch.island_from_patch))
        .maybe_reals(patch.elevation.map(|e| [e.height_m, e.variance_m2]))
        .int(patch.left_out)
        .reals(coordinates(&patch.base_from_laser))
        .maybe_reals(patch.attitude.map(attitude_numbers))
        .maybe_reals(patch.sweep.map(sweep_numbers))
}

/// A patch and its island; more may follow in the row.
pub(crate) fn read_patch(
    row: &mut CellReader,
    scan: impl FnOnce(PatchId) -> Option<Arc<Scan>>,
) -> Option<(Patch, PatchId)> {
    let (id, robot) = (PatchId(row.int()?), RobotId(row.int()?));
    let (stamp, island) = (Stamp(row.int()?), PatchId(row.int()?));
    let island_from_patch = pose(row.reals()?);
    let elevation =
        row.maybe_reals()?.map(|[height_m, variance_m2]| Elevation { height_m, variance_m2 });
    let left_out = row.flag()?;
    let base_from_laser = pose(row.reals()?);
    let attitude = row.maybe_reals()?.map(attitude);
    let sweep = row.maybe_reals()?.map(sweep);
    let scan = scan(id)?;
    let patch = Patch {
        id,
        robot,
        stamp,
        scan,
        sweep,
        base_from_laser,
        attitude,
        island_from_patch,
        elevation,
        left_out,
    };
    Some((patch, island))
}

pub(crate) fn scan_cells(patch: PatchId, beams: usize, packed: Vec<u8>) -> Cells {
    Cells::default().int(patch.0).int(beams as i64).blob(packed)
}

pub(crate) fn read_scan(mut row: CellReader) -> Option<(PatchId, Scan)> {
    let (patch, beams): (_, usize) = (PatchId(row.int()?), row.int()?);
    let scan = crate::scan_codec::unpack(&row.blob()?).filter(|scan| scan.len() == beams)?;
    row.end().map(|()| (patch, scan))
}

/// How a provenance is written in the file.
pub fn provenance_name(provenance: Provenance) -> &'static str {
    match provenance {
        Provenance::Sequential => "sequential",
        Provenance::LoopClosure => "loop-closure",
        Provenance::Landmark => "landmark",
        Provenance::Merge => "merge",
        Provenance::Rendezvous => "rendezvous",
    }
}

fn provenance(name: &str) -> Option<Provenance> {
    use Provenance::*;
    let all = [Sequential, LoopClosure, Landmark, Merge, Rendezvous];
    all.into_iter().find(|p| provenance_name(*p) == name)
}

pub(crate) fn retraction_name(reason: Retraction) -> &'static str {
    match reason {
        Retraction::Contradicted => "contradicted",
        Retraction::ByUser => "by-user",
        Retraction::BadData => "bad-data",
    }
}

pub(crate) fn retraction(name: &str) -> Option<Retraction> {
    use Retraction::*;
    [Contradicted, ByUser, BadData].into_iter().find(|r| retraction_name(*r) == name)
}

fn state_names(state: RelationState) -> (&'static str, Option<&'static str>) {
    match state {
        RelationState::Active => ("active", None),
        RelationState::Provisional => ("provisional", None),
        RelationState::Retracted(reason) => ("retracted", Some(retraction_name(reason))),
    }
}

fn state(name: &str, reason: Option<&str>) -> Option<RelationState> {
    match (name, reason) {
        ("active", None) => Some(RelationState::Active),
        ("provisional", None) => Some(RelationState::Provisional),
        ("retracted", Some(reason)) => retraction(reason).map(RelationState::Retracted),
        _ => None,
    }
}

pub(crate) fn relation_cells(relation: &Relation) -> Cells {
    let (state, reason) = state_names(relation.state);
    Cells::default()
        .int(relation.id.0)
        .int(relation.from.0)
        .int(relation.to.0)
        .text(provenance_name(relation.provenance))
        .text(state)
        .maybe_text(reason)
        .reals(gaussian(&relation.from_from_to))
}

pub(crate) fn read_relation(mut row: CellReader) -> Option<Relation> {
    let (id, from, to) = (RelationId(row.int()?), PatchId(row.int()?), PatchId(row.int()?));
    let provenance = provenance(&row.text()?)?;
    let state = state(&row.text()?, row.maybe_text()?.as_deref())?;
    let from_from_to = read_gaussian(row.reals()?);
    row.end().map(|()| Relation { id, from, to, from_from_to, provenance, state })
}

pub(crate) fn way_cells(index: usize, way: &Way) -> Cells {
    Cells::default()
        .int(index as i64)
        .int(way.from.0)
        .int(way.to.0)
        .maybe_reals(way.motion.as_ref().map(gaussian))
        .maybe_reals(way.climb.map(|c| [c.rise_m, c.distance_m, c.variance_m2]))
}

pub(crate) fn read_way(mut row: CellReader) -> Option<(usize, Way)> {
    let index = row.int()?;
    let (from, to) = (PatchId(row.int()?), PatchId(row.int()?));
    let motion = row.maybe_reals()?.map(read_gaussian);
    let climb = row.maybe_reals()?.map(|[rise_m, distance_m, variance_m2]| Climb {
        rise_m,
        distance_m,
        variance_m2,
    });
    row.end().map(|()| (index, Way { from, to, motion, climb }))
}

fn kind_name(kind: LandmarkKind) -> &'static str {
    match kind {
        LandmarkKind::Victim => "victim",
        LandmarkKind::Tag => "tag",
        LandmarkKind::Robot => "robot",
    }
}

fn kind(name: &str) -> Option<LandmarkKind> {
    use LandmarkKind::*;
    [Victim, Tag, Robot].into_iter().find(|kind| kind_name(*kind) == name)
}

pub(crate) fn sighting_cells(index: usize, sighting: &PatchSighting) -> Cells {
    let seen = &sighting.sighting;
    let c = &seen.covariance;
    Cells::default()
        .int(index as i64)
        .int(sighting.patch.0)
        .int(sighting.stamp.0)
        .text(kind_name(seen.kind))
        .maybe_text(seen.id.as_deref())
        .reals([seen.position.x, seen.position.y])
        .reals([c[(0, 0)], c[(0, 1)], c[(1, 0)], c[(1, 1)]])
        .maybe_reals(seen.yaw.map(|(yaw, variance)| [yaw, variance]))
}

pub(crate) fn read_sighting(mut row: CellReader) -> Option<(usize, PatchSighting)> {
    let index = row.int()?;
    let (patch, stamp) = (PatchId(row.int()?), Stamp(row.int()?));
    let kind = kind(&row.text()?)?;
    let id = row.maybe_text()?.map(Arc::from);
    let [x, y] = row.reals()?;
    let covariance: [f64; 4] = row.reals()?;
    let yaw = row.maybe_reals()?.map(|[yaw, variance]| (yaw, variance));
    let covariance = Matrix2::from_row_slice(&covariance);
    let sighting = Sighting { kind, id, position: Vector2::new(x, y), covariance, yaw };
    row.end().map(|()| (index, PatchSighting { patch, stamp, sighting }))
}

pub(crate) fn tracked_cells(robot: RobotId, index: usize, scan: &TrackedScan) -> Cells {
    Cells::default()
        .int(robot.0)
        .int(index as i64)
        .text(&scan.stamp_text)
        .int(scan.stamp.0)
        .int(scan.patch.0)
        .reals(coordinates(&scan.patch_from_base))
        .maybe_reals(scan.odom_from_base.as_ref().map(coordinates))
}

pub(crate) fn read_tracked(mut row: CellReader) -> Option<(RobotId, usize, TrackedScan)> {
    let (robot, index) = (RobotId(row.int()?), row.int()?);
    let scan = TrackedScan {
        stamp_text: row.text()?,
        stamp: Stamp(row.int()?),
        patch: PatchId(row.int()?),
        patch_from_base: pose(row.reals()?),
        odom_from_base: row.maybe_reals()?.map(pose),
    };
    row.end().map(|()| (robot, index, scan))
}

pub(crate) fn block_cells(index: usize, block: &ObservationBlock) -> Cells {
    Cells::default()
        .int(index as i64)
        .int(block.robot.0)
        .int(block.first_scan as i64)
        .int(block.scans as i64)
        .blob(block.data.to_vec())
}

pub(crate) fn read_block(mut row: CellReader) -> Option<(usize, ObservationBlock)> {
    let index = row.int()?;
    let robot = RobotId(row.int()?);
    let (first_scan, scans) = (row.int()?, row.int()?);
    let block = ObservationBlock { robot, first_scan, scans, data: row.blob()?.into() };
    row.end().map(|()| (index, block))
}

pub(crate) fn step_cells(step: &StepSummary) -> Cells {
    Cells::default()
        .bits(step.step)
        .int(step.time_unix_ns)
        .text(&step.note)
        .bits(step.first_change)
        .bits(step.changes)
        .bits(step.scans)
}

pub(crate) fn read_step(mut row: CellReader) -> Option<StepSummary> {
    let step = StepSummary {
        step: row.bits()?,
        time_unix_ns: row.int()?,
        note: row.text()?,
        first_change: row.bits()?,
        changes: row.bits()?,
        scans: row.bits()?,
    };
    row.end().map(|()| step)
}
