//! Reads a whole file and checks all of it on the way.

use crate::cells::CellReader;
use crate::error::{Finding, StoreError};
use crate::ledger::Ledger;
use crate::rows;
use crate::site::Site;
use crate::table::{RowRead, Table, chain};
use crate::{journal, schema};
use manifold::{Change, Manifold, PatchId};
use rusqlite::Connection;
use sensing::Scan;
use std::path::Path;
use std::sync::Arc;

/// A file's content, found whole.
#[derive(Debug, Default)]
pub(crate) struct Loaded {
    pub site: Site,
    pub ledger: Ledger,
    /// The first patch of each patch's island.
    pub islands: Vec<PatchId>,
    /// Schema versions the file has had, with the programs that wrote them.
    pub versions: Vec<(i64, String)>,
}

impl Loaded {
    /// The file's schema version; 0 of a file that is being made.
    pub fn version(&self) -> i64 {
        self.versions.last().map_or(0, |(version, _)| *version)
    }
}

/// Reads the tables of the state and the journal, as of one moment.
///
/// # Errors
/// [`StoreError::Damaged`] when anything is not as it was written.
pub(crate) fn load(connection: &Connection, file: &Path) -> Result<Loaded, StoreError> {
    let sqlite = |cause| StoreError::database(file, cause);
    let _one_moment = connection.unchecked_transaction().map_err(sqlite)?;
    let version = schema::version(connection, file)?;
    let mut reading = Reading::new(connection);
    reading.findings.extend(schema::problems(connection, version).map_err(sqlite)?);
    let loaded = reading.state(version);
    reading.chain();
    if reading.findings.is_empty() {
        let tables = rows::state_of(version);
        let differing = reading.ledger.compare(connection, tables).map_err(sqlite)?;
        reading.findings.extend(differing);
    }
    if let (Some((site, islands, versions)), true) = (loaded, reading.findings.is_empty()) {
        return Ok(Loaded { site, ledger: reading.ledger, islands, versions });
    }
    Err(StoreError::Damaged { file: file.to_owned(), findings: reading.findings })
}

pub(crate) type State = (Site, Vec<PatchId>, Vec<(i64, String)>);

/// Reads rows and keeps a list of those that are not as they should be.
pub(crate) struct Reading<'a> {
    connection: &'a Connection,
    pub ledger: Ledger,
    pub findings: Vec<Finding>,
}

impl<'a> Reading<'a> {
    pub fn new(connection: &'a Connection) -> Self {
        Reading { connection, ledger: Ledger::default(), findings: Vec::new() }
    }

    pub fn object(&mut self, place: &str, problem: impl Into<String>) {
        self.findings.push(Finding { place: place.to_owned(), problem: problem.into() });
    }

    /// All whole rows of a table that can be understood.
    pub fn rows<T>(
        &mut self,
        table: &Table,
        mut understand: impl FnMut(CellReader) -> Option<T>,
    ) -> Vec<T> {
        let (mut understood, mut bad) = (Vec::new(), 0);
        let read = table.read(self.connection, |row| match row {
            RowRead::Whole(cells, checksum) => {
                self.ledger.note(table, &cells, checksum);
                match understand(cells.reader()) {
                    Some(row) => understood.push(row),
                    None => bad += 1,
                }
            }
            RowRead::Damaged => bad += 1,
        });
        if bad > 0 {
            self.object(table.name, format!("{bad} damaged rows"));
        }
        if let Err(cause) = read {
            self.object(table.name, format!("reading stopped: {cause}"));
        }
        understood
    }

    /// Rows numbered from 0 without gaps.
    fn numbered<T>(
        &mut self,
        table: &Table,
        understand: impl FnMut(CellReader) -> Option<(usize, T)>,
    ) -> Vec<T> {
        let rows = self.rows(table, understand);
        if rows.iter().enumerate().any(|(i, (number, _))| i != *number) {
            self.object(table.name, "rows are missing");
        }
        rows.into_iter().map(|(_, row)| row).collect()
    }

    /// The state, when it makes sense.
    pub fn state(&mut self, version: i64) -> Option<State> {
        let versions = self.rows(&rows::VERSIONS, rows::read_version);
        let mut site = Site { manifold: Manifold::new(), ..Site::default() };
        site.metadata = self.rows(&rows::METADATA, rows::read_metadata).into_iter().collect();
        let islands = self.manifold(&mut site.manifold)?;
        if islands != site.island_names() {
            self.object(rows::PATCHES.name, "islands are not those of the relations");
        }
        let robots = site.manifold.robots().len();
        let logs = self.rows(&rows::LOGS, rows::read_log);
        if logs.iter().any(|log| usize::from(log.robot.0) >= robots) {
            self.object(rows::LOGS.name, "a log of an unknown robot");
        }
        site.logs = logs.into_iter().map(|log| (log.robot, log)).collect();
        site.trajectories.resize_with(robots, Vec::new);
        let follow = self.rows(&rows::TRAJECTORY, rows::read_tracked).into_iter().all(
            |(robot, index, scan)| {
                let added =
                    index == site.trajectories.get(usize::from(robot.0)).map_or(0, Vec::len);
                added && site.track(robot, index, scan).is_some()
            },
        );
        if !follow {
            self.object(rows::TRAJECTORY.name, "rows are missing");
        }
        if version >= schema::WITH_OBSERVATIONS {
            let blocks = self.numbered(&rows::OBSERVATIONS, rows::read_block);
            if !blocks.into_iter().all(|block| site.observe(block).is_some()) {
                self.object(rows::OBSERVATIONS.name, "scans that no trajectory has");
            }
        }
        site.steps = self.numbered(&rows::STEPS, |row| {
            let step = rows::read_step(row)?;
            Some((usize::try_from(step.step).ok()?, step))
        });
        Some((site, islands, versions))
    }

    /// The map by its tables; returns the islands' names.
    fn manifold(&mut self, manifold: &mut Manifold) -> Option<Vec<PatchId>> {
        let scans: Vec<Arc<Scan>> = self.numbered(&rows::SCANS, |row| {
            rows::read_scan(row).map(|(patch, scan)| (patch.index(), Arc::new(scan)))
        });
        let robots = self.numbered(&rows::ROBOTS, |row| {
            rows::read_robot(row).map(|robot| (usize::from(robot.id.0), robot))
        });
        let patches = self.numbered(&rows::PATCHES, |mut row| {
            let read = rows::read_patch(&mut row, |id| scans.get(id.index()).cloned())?;
            row.end().map(|()| (read.0.id.index(), read))
        });
        if patches.len() != scans.len() {
            self.object(rows::PATCHES.name, "not as many patches as scans");
        }
        let relations = self.numbered(&rows::RELATIONS, |row| {
            rows::read_relation(row).map(|relation| (relation.id.index(), relation))
        });
        let ways = self.numbered(&rows::WAYS, rows::read_way);
        let sightings = self.numbered(&rows::SIGHTINGS, rows::read_sighting);
        let islands = patches.iter().map(|(_, island)| *island).collect();
        let robots = robots.into_iter().map(Change::RobotJoined);
        let patches = patches.into_iter().map(|(patch, _)| Change::PatchAdded(patch));
        let relations = relations.into_iter().map(Change::RelationAdded);
        let ways = ways.into_iter().map(Change::WayNoted);
        let sightings = sightings.into_iter().map(Change::LandmarkSighted);
        let mut all = robots.chain(patches).chain(relations).chain(ways).chain(sightings);
        let follow = all.all(|change| manifold.apply(&change).is_ok());
        manifold.take_journal();
        if !follow {
            self.object("map", "rows name patches or robots that are not there");
        }
        follow.then_some(islands)
    }

    /// Follows the journal's chain.
    pub fn chain(&mut self) {
        let ledger = &mut self.ledger;
        let followed = read_journal(self.connection, |row| {
            let whole = row.is_next(ledger.journal.rows, ledger.journal.sum);
            if whole {
                ledger.link(row.chain);
            }
            whole
        });
        match followed {
            Ok(true) => {}
            Ok(false) => {
                let at = self.ledger.journal.rows;
                self.object("changes", format!("the chain breaks at change {at}"));
            }
            Err(cause) => self.object("changes", format!("reading stopped: {cause}")),
        }
    }
}

/// A row of the journal.
pub(crate) struct JournalRow {
    pub change: i64,
    pub step: i64,
    pub kind: String,
    pub payload: Vec<u8>,
    pub chain: u64,
}

impl JournalRow {
    /// True when the row is the journal's `change`-th, as it was written.
    pub fn is_next(&self, change: u64, before: u64) -> bool {
        let link = chain(before, change, self.step as u64, &self.kind, &self.payload);
        self.change as u64 == change && link == self.chain
    }
}

/// Reads the journal in order, until `take` says no; false when it did.
pub(crate) fn read_journal(
    connection: &Connection,
    mut take: impl FnMut(JournalRow) -> bool,
) -> rusqlite::Result<bool> {
    let sql = "SELECT change, step, kind, payload, chain FROM changes ORDER BY change";
    let mut statement = connection.prepare(sql)?;
    let mut found = statement.query([])?;
    while let Some(row) = found.next()? {
        let row = JournalRow {
            change: row.get(0)?,
            step: row.get(1)?,
            kind: row.get(2)?,
            payload: row.get(3)?,
            chain: row.get::<_, i64>(4)? as u64,
        };
        if !take(row) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Replays the whole journal and tells every row of the state that comes out otherwise, bit by bit.
pub(crate) fn replayed(connection: &Connection, loaded: &Loaded) -> rusqlite::Result<Vec<Finding>> {
    let mut replica = Manifold::new();
    let patches = loaded.site.manifold.patches();
    let scan = |patch: PatchId, checksum| {
        let known = loaded.ledger.checksum(&rows::SCANS, patch.0.into());
        patches.get(patch.index()).filter(|_| known == Some(checksum)).map(|p| p.scan.clone())
    };
    let mut broken = None;
    read_journal(connection, |row| {
        let change = journal::read(&row.kind, &row.payload, scan);
        let applied = change.is_some_and(|change| replica.apply(&change).is_ok());
        replica.take_journal();
        if !applied {
            broken = Some(row.change);
        }
        applied
    })?;
    let mut findings = Vec::new();
    if let Some(change) = broken {
        let problem = format!("change {change} does not follow on those before it");
        findings.push(Finding { place: "changes".into(), problem });
    }
    let replica = Site { manifold: replica, ..Site::default() };
    for (mine, theirs) in state_bytes(&loaded.site).into_iter().zip(state_bytes(&replica)) {
        if mine.1 != theirs.1 {
            let problem = "not what the journal tells".into();
            findings.push(Finding { place: mine.0.into(), problem });
        }
    }
    Ok(findings)
}

/// The rows of a map, table by table: two maps are the same when these are.
fn state_bytes(site: &Site) -> [(&'static str, Vec<Vec<u8>>); 5] {
    let map = &site.manifold;
    let islands = site.island_names();
    let bytes = |cells: crate::cells::Cells| cells.to_bytes();
    let robots = map.robots().iter().map(|r| bytes(rows::robot_cells(r))).collect();
    let patches = map.patches().iter().zip(&islands);
    let patches = patches.map(|(p, island)| bytes(rows::patch_cells(p, *island))).collect();
    let relations = map.relations().iter().map(|r| bytes(rows::relation_cells(r))).collect();
    let ways = map.ways().iter().enumerate();
    let ways = ways.map(|(i, w)| bytes(rows::way_cells(i, w))).collect();
    let sightings = map.sightings().iter().enumerate();
    let sightings = sightings.map(|(i, s)| bytes(rows::sighting_cells(i, s))).collect();
    [
        (rows::ROBOTS.name, robots),
        (rows::PATCHES.name, patches),
        (rows::RELATIONS.name, relations),
        (rows::WAYS.name, ways),
        (rows::SIGHTINGS.name, sightings),
    ]
}

/// True when two maps are the same bit by bit, their scans included: what tests and salvage mean by
/// the same map.
pub fn same_map(a: &Manifold, b: &Manifold) -> bool {
    let site = |m: &Manifold| Site { manifold: m.clone(), ..Site::default() };
    state_bytes(&site(a)) == state_bytes(&site(b))
        && a.patches().iter().zip(b.patches()).all(|(a, b)| {
            Arc::ptr_eq(&a.scan, &b.scan) || crate::scan_codec::same_bits(&a.scan, &b.scan)
        })
}
