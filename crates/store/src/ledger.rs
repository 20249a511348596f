//! The checksums of all rows of the state, so that digests can be kept up to date.

use crate::cells::Cells;
use crate::error::Finding;
use crate::rows::STATE;
use crate::table::{Digest, Table};
use rusqlite::Connection;
use std::collections::{BTreeMap, BTreeSet};

/// Name of the digest of the journal: how many changes, and the chain's last link.
pub(crate) const CHANGES: &str = "changes";

/// What the file's digests should say.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    tables: BTreeMap<&'static str, Known>,
    /// Changes in the journal, and the chain's last link.
    pub journal: Digest,
    /// Digests that the file does not have yet.
    stale: BTreeSet<&'static str>,
}

#[derive(Debug, Default)]
struct Known {
    digest: Digest,
    /// Checksums by the bytes of the row's key.
    rows: BTreeMap<Box<[u8]>, u64>,
}

impl Ledger {
    /// Takes note of a row that is written or read.
    pub fn note(&mut self, table: &Table, cells: &Cells, checksum: u64) {
        let known = self.tables.entry(table.name).or_default();
        let key = Cells(cells.0[..table.key].to_vec()).to_bytes();
        if let Some(old) = known.rows.insert(key.into(), checksum) {
            known.digest.remove(old);
        }
        known.digest.add(checksum);
        self.stale.insert(table.name);
    }

    /// Writes a row; returns its checksum.
    pub fn put(
        &mut self,
        connection: &Connection,
        table: &Table,
        cells: &Cells,
    ) -> rusqlite::Result<u64> {
        let checksum = table.put(connection, cells)?;
        self.note(table, cells, checksum);
        Ok(checksum)
    }

    /// The checksum of the row with an integer key.
    pub fn checksum(&self, table: &Table, key: i64) -> Option<u64> {
        let key = Cells::default().int(key).to_bytes();
        self.tables.get(table.name)?.rows.get(&key[..]).copied()
    }

    /// Takes note of a new table without rows.
    pub fn begin(&mut self, table: &Table) {
        self.stale.insert(table.name);
    }

    /// Adds a link to the chain of changes.
    pub fn link(&mut self, chain: u64) {
        self.journal = Digest { rows: self.journal.rows + 1, sum: chain };
        self.stale.insert(CHANGES);
    }

    /// Writes the digests that are not up to date.
    pub fn write(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        for name in std::mem::take(&mut self.stale) {
            write_digest(connection, name, self.digest(name))?;
        }
        Ok(())
    }

    /// Writes all digests: a new file has one for every table.
    pub fn write_all(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        self.stale = STATE.iter().map(|table| table.name).chain([CHANGES]).collect();
        self.write(connection)
    }

    /// Compares with the digests in the file, which holds what was read from these tables.
    pub fn compare(
        &mut self,
        connection: &Connection,
        tables: &[Table],
    ) -> rusqlite::Result<Vec<Finding>> {
        let mut findings = self.compare_state(connection, tables)?;
        findings.extend(self.compare_one(connection, CHANGES)?);
        let sql = "SELECT count(*) FROM digests";
        let count: i64 = connection.query_row(sql, [], |row| row.get(0))?;
        if count != tables.len() as i64 + 1 {
            let problem = format!("{count} rows, expected {}", tables.len() + 1);
            findings.push(Finding { place: "digests".into(), problem });
        }
        Ok(findings)
    }

    /// The same for the tables of the state alone.
    pub fn compare_state(
        &mut self,
        connection: &Connection,
        tables: &[Table],
    ) -> rusqlite::Result<Vec<Finding>> {
        self.stale.clear();
        let compared = tables.iter().map(|table| self.compare_one(connection, table.name));
        compared.filter_map(Result::transpose).collect()
    }

    fn compare_one(
        &self,
        connection: &Connection,
        name: &str,
    ) -> rusqlite::Result<Option<Finding>> {
        let found = self.digest(name);
        let problem = match read_digest(connection, name)? {
            None => "its digest is missing or damaged".into(),
            Some(expected) if expected.rows != found.rows => {
                format!("{} of {} rows are whole", found.rows, expected.rows)
            }
            Some(expected) if expected != found => {
                "its rows are not those that were written".into()
            }
            Some(_) => return Ok(None),
        };
        Ok(Some(Finding { place: name.to_owned(), problem }))
    }

    /// True when not a single row is known.
    pub fn is_empty(&self) -> bool {
        self.journal.rows == 0 && self.tables.values().all(|known| known.rows.is_empty())
    }

    fn digest(&self, name: &str) -> Digest {
        match name {
            CHANGES => self.journal,
            table => self.tables.get(table).map(|known| known.digest).unwrap_or_default(),
        }
    }
}

/// How far the journal goes, by the digest in the file.
pub(crate) fn read_journal_digest(connection: &Connection) -> rusqlite::Result<Option<Digest>> {
    read_digest(connection, CHANGES)
}

/// A digest's own checksum.
fn checksum(name: &str, digest: Digest) -> i64 {
    let cells = Cells::default().text(name).bits(digest.rows).bits(digest.sum);
    crate::checksum::crc64(&cells.to_bytes()) as i64
}

fn write_digest(connection: &Connection, name: &str, digest: Digest) -> rusqlite::Result<()> {
    let sql = "INSERT OR REPLACE INTO digests VALUES (?, ?, ?, ?)";
    let row = (name, digest.rows as i64, digest.sum as i64, checksum(name, digest));
    connection.prepare_cached(sql)?.execute(row)?;
    Ok(())
}

/// `None` when it is missing or its own checksum is wrong.
pub(crate) fn read_digest(connection: &Connection, name: &str) -> rusqlite::Result<Option<Digest>> {
    let sql = "SELECT rows, sum, checksum FROM digests WHERE name = ?";
    let mut statement = connection.prepare_cached(sql)?;
    let mut rows = statement.query([name])?;
    let Some(row) = rows.next()? else { return Ok(None) };
    let numbers: [Option<i64>; 3] = [0, 1, 2].map(|i| row.get(i).ok());
    let [Some(count), Some(sum), Some(own)] = numbers else { return Ok(None) };
    let digest = Digest { rows: count as u64, sum: sum as u64 };
    Ok((checksum(name, digest) == own).then_some(digest))
}
