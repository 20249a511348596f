//! A step as rows.

use crate::cells::Cells;
use crate::error::StoreError;
use crate::journal;
use crate::loading::Loaded;
use crate::rows;
use crate::scan_codec::pack;
use crate::site::{Step, StepSummary};
use crate::table::Table;
use manifold::{Change, PatchId, RelationId};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What a step writes: rows of the state, then changes for the journal.
pub(crate) struct Prepared {
    pub step: u64,
    pub rows: Vec<(Table, Cells)>,
    /// Patches that are new or have moved.
    pub patches: BTreeSet<PatchId>,
    pub changes: Vec<(&'static str, Vec<u8>)>,
}

/// Performs the step in memory and says what has to be written so that the file follows.
pub(crate) fn prepare(
    file: &Path,
    loaded: &mut Loaded,
    step: &Step,
) -> Result<Prepared, StoreError> {
    let scans = pack_scans(file, step)?;
    let map = &loaded.site.manifold;
    let observed = loaded.site.observations.len();
    let noted = (map.ways().len(), map.sightings().len());
    loaded
        .site
        .perform(step)
        .map_err(|cause| StoreError::OutOfOrder { file: file.to_owned(), cause })?;
    let changes: Vec<_> = journal::fold(&step.changes)
        .iter()
        .map(|change| {
            let scan = match change {
                Change::PatchAdded(patch) => scans.get(&patch.id),
                _ => None,
            };
            journal::write(change, scan.map(|cells| rows::SCANS.checksum(cells)))
        })
        .collect();
    let summary = StepSummary {
        step: loaded.site.steps.len() as u64,
        time_unix_ns: step.time_unix_ns,
        note: step.note.clone(),
        first_change: loaded.ledger.journal.rows,
        changes: changes.len() as u64,
        scans: step.scans.len() as u64,
    };
    let mut rows: Vec<(Table, Cells)> =
        scans.into_values().map(|cells| (rows::SCANS, cells)).collect();
    let (patches, relations) = touched(loaded, step);
    rows.extend(map_rows(loaded, step, &patches, &relations, noted));
    rows.extend(site_rows(loaded, step));
    let blocks = &loaded.site.observations[observed..];
    rows.extend(
        (observed..)
            .zip(blocks)
            .map(|(i, block)| (rows::OBSERVATIONS, rows::block_cells(i, block))),
    );
    rows.push((rows::STEPS, rows::step_cells(&summary)));
    let numbers = rows.iter().map(|(table, cells)| (table.name, cells));
    let in_changes = changes.iter().map(|(_, cells)| ("changes", cells));
    if let Some((table, _)) = numbers.chain(in_changes).find(|(_, cells)| !cells.is_finite()) {
        return Err(StoreError::NotFinite { file: file.to_owned(), table });
    }
    let number = summary.step;
    loaded.site.steps.push(summary);
    let changes = changes.into_iter().map(|(kind, cells)| (kind, cells.to_bytes())).collect();
    Ok(Prepared { step: number, rows, patches, changes })
}

/// The rows of the scans of new patches.
fn pack_scans(file: &Path, step: &Step) -> Result<BTreeMap<PatchId, Cells>, StoreError> {
    let mut scans = BTreeMap::new();
    for change in &step.changes {
        let Change::PatchAdded(patch) = change else { continue };
        let refused = || StoreError::Scan { file: file.to_owned(), patch: patch.id };
        let packed = pack(&patch.scan).ok_or_else(refused)?;
        scans.insert(patch.id, rows::scan_cells(patch.id, patch.scan.len(), packed));
    }
    Ok(scans)
}

/// The rows of the map that a step has touched, the step being performed already.
fn map_rows(
    loaded: &Loaded,
    step: &Step,
    patches: &BTreeSet<PatchId>,
    relations: &BTreeSet<RelationId>,
    (ways, sightings): (usize, usize),
) -> Vec<(Table, Cells)> {
    let map = &loaded.site.manifold;
    let robots = step.changes.iter().filter_map(|change| match change {
        Change::RobotJoined(robot) => Some((rows::ROBOTS, rows::robot_cells(robot))),
        _ => None,
    });
    let patches = patches
        .iter()
        .map(|id| (rows::PATCHES, rows::patch_cells(map.patch(*id), loaded.islands[id.index()])));
    let relations =
        relations.iter().map(|id| (rows::RELATIONS, rows::relation_cells(map.relation(*id))));
    let ways = map.ways().iter().enumerate().skip(ways);
    let ways = ways.map(|(i, way)| (rows::WAYS, rows::way_cells(i, way)));
    let sightings = map.sightings().iter().enumerate().skip(sightings);
    let sightings = sightings.map(|(i, seen)| (rows::SIGHTINGS, rows::sighting_cells(i, seen)));
    robots.chain(patches).chain(relations).chain(ways).chain(sightings).collect()
}

/// The patches and relations whose rows change: those that the step names, and the patches that
/// come to belong to other islands.
fn touched(loaded: &mut Loaded, step: &Step) -> (BTreeSet<PatchId>, BTreeSet<RelationId>) {
    let (mut patches, mut relations) = (BTreeSet::new(), BTreeSet::new());
    for change in &step.changes {
        match change {
            Change::PatchAdded(patch) => patches.extend([patch.id]),
            Change::PosesReestimated(poses) => patches.extend(poses.iter().map(|p| p.0)),
            Change::ElevationsReestimated(heights) => patches.extend(heights.iter().map(|h| h.0)),
            Change::LeftOut(out, _) => patches.extend(out),
            Change::RelationAdded(relation) => relations.extend([relation.id]),
            Change::RelationConfirmed(id) => relations.extend([*id]),
            Change::RelationRetracted(id, _) => relations.extend([*id]),
            Change::RobotJoined(_) | Change::WayNoted(_) | Change::LandmarkSighted(_) => {}
        }
    }
    if !relations.is_empty() || !patches.is_empty() {
        let islands = loaded.site.island_names();
        let moved = islands.iter().enumerate().filter(|(i, n)| loaded.islands.get(*i) != Some(n));
        patches.extend(moved.map(|(i, _)| PatchId(i as u32)));
        loaded.islands = islands;
    }
    (patches, relations)
}

/// The rows of logs, trajectories and metadata that a step has touched.
fn site_rows(loaded: &Loaded, step: &Step) -> Vec<(Table, Cells)> {
    let site = &loaded.site;
    let logs: BTreeSet<_> = step.logs.iter().map(|log| log.robot).collect();
    let scans: BTreeSet<_> = step.scans.iter().map(|(robot, index, _)| (*robot, *index)).collect();
    let keys: BTreeSet<_> = step.metadata.iter().map(|(key, _)| key).collect();
    let logs = logs.iter().map(|robot| (rows::LOGS, rows::log_cells(&site.logs[robot])));
    let scans = scans.iter().map(|(robot, index)| {
        let scan = &site.trajectories[usize::from(robot.0)][*index];
        (rows::TRAJECTORY, rows::tracked_cells(*robot, *index, scan))
    });
    let metadata =
        keys.iter().map(|key| (rows::METADATA, rows::metadata_cells(key, &site.metadata[*key])));
    logs.chain(scans).chain(metadata).collect()
}
