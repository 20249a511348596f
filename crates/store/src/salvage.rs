use crate::connecting::{check_header, for_reading, has_log};
use crate::error::{Finding, StoreError};
use crate::ledger::read_digest;
use crate::loading::{Reading, load, read_journal};
use crate::schema::{FIRST_PAGES, PAGE_SIZE, first_page};
use crate::site::{Site, Step, changes_of};
use crate::sqlite::SqliteStore;
use crate::store::Store;
use crate::table::{RowRead, Table};
use crate::{journal, rows, schema};
use manifold::{Change, Manifold, PatchId};
use rusqlite::{Connection, MAIN_DB};
use sensing::{LaserModel, RobotId, Scan};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// What could be had of a file.
#[derive(Debug, Default)]
pub struct Salvaged {
    /// The map as of the longest part of the journal that is whole, and what else is whole.
    pub site: Site,
    /// Damage that cost nothing: what it hit is told elsewhere in the file.
    pub repaired: Vec<Finding>,
    /// What is lost.
    pub lost: Vec<Finding>,
}

/// Takes out of a file what is whole; the file stays as it is.
///
/// A file without damage gives all of it. Where the tables of the state are whole, the map is
/// theirs; else it is what the journal tells up to its first row that is not as it was written: an
/// older map, but never a mixture. A patch whose scan is lost keeps its place and its relations,
/// with a scan of no beams, and is left out of the map. Where even the first page is gone, that of
/// an empty file stands in for it.
///
/// # Errors
/// [`StoreError::File`], [`StoreError::Newer`], and [`StoreError::Foreign`] where nothing in the
/// file is ours.
pub fn salvage(file: &Path) -> Result<Salvaged, StoreError> {
    let opened = check_header(file).and_then(|()| for_reading(file));
    let whole = opened.map(|connection| (load(&connection, file), connection));
    let (connection, mut repaired) = match whole {
        Err(error @ StoreError::File { .. }) => return Err(error),
        Ok((Err(error @ StoreError::Newer { .. }), _)) => return Err(error),
        Ok((Ok(loaded), _)) => return Ok(Salvaged { site: loaded.site, ..Salvaged::default() }),
        Ok((Err(_), connection)) if has_schema(&connection) => (connection, Vec::new()),
        Ok((Err(error), _)) | Err(error) => (image(file)?, findings(error)),
    };
    let mut salvaged = pick(&connection, file)?;
    if !repaired.is_empty() && has_log(file) {
        let problem = "what its log beside it holds could not be added".into();
        salvaged.lost.push(Finding { place: "file".into(), problem });
    }
    repaired.append(&mut salvaged.repaired);
    salvaged.repaired = repaired;
    Ok(salvaged)
}

impl Salvaged {
    /// Writes what was salvaged into a new file, as one step: its history begins anew.
    ///
    /// # Errors
    /// Those of [`SqliteStore::create`] and [`Store::write`].
    pub fn write(&self, new: &Path, program: &str, time_unix_ns: i64) -> Result<(), StoreError> {
        let site = &self.site;
        let of_robot = |(robot, scans): (usize, &Vec<crate::TrackedScan>)| {
            let numbered = scans.clone().into_iter().enumerate();
            numbered.map(move |(i, scan)| (RobotId(robot as u16), i, scan)).collect::<Vec<_>>()
        };
        let step = Step {
            time_unix_ns,
            note: "salvaged".into(),
            changes: changes_of(&site.manifold),
            logs: site.logs.values().cloned().collect(),
            scans: site.trajectories.iter().enumerate().flat_map(of_robot).collect(),
            observations: site.observations.clone(),
            metadata: site.metadata.clone().into_iter().collect(),
        };
        let mut store = SqliteStore::create(new, program)?;
        store.write(&step)?;
        store.close()
    }
}

/// What an error says of the damage.
fn findings(error: StoreError) -> Vec<Finding> {
    match error {
        StoreError::Damaged { findings, .. } => findings,
        other => vec![Finding { place: "file".into(), problem: other.to_string() }],
    }
}

/// True when the tables of the first version are there to be read.
fn has_schema(connection: &Connection) -> bool {
    schema::problems(connection, 1)
        .is_ok_and(|found| !found.iter().any(|f| f.problem.ends_with(schema::MISSING)))
}

/// True when the table that the third version brought is there.
fn has_observations(connection: &Connection) -> bool {
    let sql = "SELECT count(*) FROM sqlite_schema WHERE name = ?";
    connection.query_row(sql, [rows::OBSERVATIONS.name], |row| row.get(0)) == Ok(1)
}

/// The file in memory, with the first page of an empty file: tables begin at the same pages in all
/// files.
fn image(file: &Path) -> Result<Connection, StoreError> {
    let sqlite = |cause| StoreError::database(file, cause);
    let mut bytes = std::fs::read(file).map_err(|cause| StoreError::file(file, cause))?;
    let page = PAGE_SIZE as usize;
    // SQLite refuses a schema whose tables begin behind the end of the file.
    let pages = bytes.len().div_ceil(page).max(FIRST_PAGES);
    bytes.resize(pages * page, 0);
    bytes[..page].copy_from_slice(&first_page().map_err(sqlite)?);
    bytes[28..32].copy_from_slice(&(pages as u32).to_be_bytes());
    let mut connection = Connection::open_in_memory().map_err(sqlite)?;
    let size = bytes.len();
    connection.deserialize_read_exact(MAIN_DB, &bytes[..], size, true).map_err(sqlite)?;
    connection.pragma_update(None, "cell_size_check", true).map_err(sqlite)?;
    Ok(connection)
}

/// Takes what is whole.
fn pick(connection: &Connection, file: &Path) -> Result<Salvaged, StoreError> {
    let mut reading = Reading::new(connection);
    let version = if has_observations(connection) { schema::WITH_OBSERVATIONS } else { 1 };
    let state = reading.state(version);
    let differing = reading.ledger.compare_state(connection, rows::state_of(version));
    let state_is_whole = reading.findings.is_empty() && differing.as_ref().is_ok_and(Vec::is_empty);
    let mut found = std::mem::take(&mut reading.findings);
    found.extend(differing.unwrap_or_default());
    reading.chain();
    let known = reading.ledger.journal.rows;
    if known == 0 && reading.ledger.is_empty() {
        return Err(StoreError::foreign(file, "nothing in it is a manifold file's"));
    }
    let expected = read_digest(connection, crate::ledger::CHANGES).ok().flatten();
    if let (Some((site, ..)), true) = (state, state_is_whole) {
        let mut salvaged = Salvaged { site, ..Salvaged::default() };
        salvaged.count_observations(connection);
        if expected != Some(reading.ledger.journal) {
            let what = format!("history from change {known} on; the map itself is whole");
            salvaged.lose("changes", &what);
        }
        return Ok(salvaged);
    }
    let mut salvaged = Salvaged::default();
    let replayed = replay(connection, &mut salvaged);
    match expected {
        Some(digest) if digest.rows == replayed => {}
        Some(digest) => salvaged.lose("changes", &format!("{replayed} to {}", digest.rows)),
        None => salvaged.lose("changes", &format!("perhaps some after the first {replayed}")),
    }
    salvaged.beside(connection);
    // Damage to tables that the journal makes good again.
    let again = [&rows::ROBOTS, &rows::PATCHES, &rows::RELATIONS, &rows::WAYS, &rows::SIGHTINGS];
    let again = again.map(|table| table.name);
    found.retain(|f| again.contains(&f.place.as_str()) || f.place == "map");
    salvaged.repaired = found;
    Ok(salvaged)
}

/// Replays the journal as far as it is whole; returns how many changes that are.
fn replay(connection: &Connection, salvaged: &mut Salvaged) -> u64 {
    let (mut map, mut without_scan) = (Manifold::new(), BTreeSet::new());
    let (mut count, mut before) = (0, 0);
    let scan = |patch: PatchId, checksum: u64| match rows::SCANS.read_one(connection, patch.0) {
        Ok(Some(RowRead::Whole(cells, found))) if found == checksum => {
            rows::read_scan(cells.reader()).map(|(_, scan)| Arc::new(scan))
        }
        _ => None,
    };
    // An error of reading ends the journal like a row that is damaged.
    let _ = read_journal(connection, |row| {
        let mut lost = None;
        let change = journal::read(&row.kind, &row.payload, |patch, checksum| {
            let found = scan(patch, checksum);
            lost = found.is_none().then_some(patch);
            Some(found.unwrap_or_else(|| Arc::new(Scan::classify(LaserModel::half_circle(0), &[]))))
        });
        let follows = row.is_next(count, before)
            && change.is_some_and(|change: Change| map.apply(&change).is_ok());
        if follows {
            (count, before) = (count + 1, row.chain);
            without_scan.extend(lost);
        }
        follows
    });
    for patch in &without_scan {
        salvaged.lose("scans", &format!("the scan of patch {}; it is left out", patch.0));
    }
    map.leave_out(without_scan.into_iter().collect(), true);
    map.take_journal();
    salvaged.site.manifold = map;
    count
}

impl Salvaged {
    fn lose(&mut self, place: &str, what: &str) {
        self.lost.push(Finding { place: place.to_owned(), problem: what.to_owned() });
    }

    /// What stands beside the map: metadata, logs, trajectories, steps.
    fn beside(&mut self, connection: &Connection) {
        let mut reading = Reading::new(connection);
        let robots = self.site.manifold.robots().len();
        let metadata = reading.rows(&rows::METADATA, rows::read_metadata);
        self.count(connection, &rows::METADATA, metadata.len());
        self.site.metadata = metadata.into_iter().collect();
        let mut logs = reading.rows(&rows::LOGS, rows::read_log);
        logs.retain(|log| usize::from(log.robot.0) < robots);
        self.count(connection, &rows::LOGS, logs.len());
        self.site.logs = logs.into_iter().map(|log| (log.robot, log)).collect();
        self.site.trajectories.resize_with(robots, Vec::new);
        let mut kept = 0;
        for (robot, _, scan) in reading.rows(&rows::TRAJECTORY, rows::read_tracked) {
            let place = self.site.trajectories.get(usize::from(robot.0)).map_or(0, Vec::len);
            kept += usize::from(self.site.track(robot, place, scan).is_some());
        }
        self.count(connection, &rows::TRAJECTORY, kept);
        if has_observations(connection) {
            for (_, block) in reading.rows(&rows::OBSERVATIONS, rows::read_block) {
                // A block whose scans are lost is lost with them.
                let _ = self.site.observe(block);
            }
        }
        self.count_observations(connection);
        self.site.steps = reading.rows(&rows::STEPS, rows::read_step);
        self.count(connection, &rows::STEPS, self.site.steps.len());
    }

    /// Files of older versions have none, and nothing is lost.
    fn count_observations(&mut self, connection: &Connection) {
        let known = read_digest(connection, rows::OBSERVATIONS.name).ok().flatten();
        if has_observations(connection) || known.is_some() {
            self.count(connection, &rows::OBSERVATIONS, self.site.observations.len());
        }
    }

    /// Compares with how many rows there should be.
    fn count(&mut self, connection: &Connection, table: &Table, kept: usize) {
        match read_digest(connection, table.name).ok().flatten() {
            Some(digest) if digest.rows == kept as u64 => {}
            Some(digest) => {
                let lost = digest.rows.saturating_sub(kept as u64);
                self.lose(table.name, &format!("{lost} of {} rows", digest.rows));
            }
            None => self.lose(table.name, &format!("perhaps rows beside the {kept} found")),
        }
    }
}
