use crate::connecting::{check_header, for_reading, for_writing};
use crate::error::{Finding, StoreError};
use crate::ledger::read_journal_digest;
use crate::loading::{Loaded, load, replayed};
use crate::lock::{WriterLock, beside};
use crate::places;
use crate::schema::{self, APPLICATION_ID, PAGE_SIZE, SCHEMA_VERSION, migrate};
use crate::site::{Site, Step};
use crate::store::Store;
use crate::writing::{Prepared, prepare};
use rusqlite::{Connection, TransactionBehavior};
use std::path::{Path, PathBuf};

/// A manifold file that is open for writing: the one writer.
///
/// Every step is one transaction in SQLite's write-ahead log, on disk when [`Store::write`] returns
/// (`synchronous = FULL`). Closing it, or dropping it, leaves a single file.
#[derive(Debug)]
pub struct SqliteStore {
    file: PathBuf,
    connection: Option<Connection>,
    loaded: Loaded,
    /// A step could not be written: what is in memory is ahead of the file.
    failed: bool,
    // Dropped last: the right to write is given back when nothing is open any more.
    _lock: WriterLock,
}

impl SqliteStore {
    /// Makes a new file, of no robots and no patches. `program` is the version of the program, for
    /// those who meet the file later.
    ///
    /// # Errors
    /// [`StoreError::File`] where there is something of that name, or it cannot be written;
    /// [`StoreError::Locked`].
    pub fn create(file: &Path, program: &str) -> Result<Self, StoreError> {
        let lock = WriterLock::take(file)?;
        if file.exists() {
            let exists = std::io::Error::from(std::io::ErrorKind::AlreadyExists);
            return Err(StoreError::file(file, exists));
        }
        write_empty(file, program)?;
        Self::open_locked(file, program, lock)
    }

    /// Opens a file for writing: reads all of it, brings an older schema up to date.
    ///
    /// # Errors
    /// [`StoreError`] says why not; the file is then as it was.
    pub fn open(file: &Path, program: &str) -> Result<Self, StoreError> {
        check_header(file)?;
        let lock = WriterLock::take(file)?;
        Self::open_locked(file, program, lock)
    }

    fn open_locked(file: &Path, program: &str, lock: WriterLock) -> Result<Self, StoreError> {
        let sqlite = |cause| StoreError::database(file, cause);
        let mut connection = for_writing(file)?;
        let mut loaded = load(&connection, file)?;
        connection.pragma_update(None, "journal_mode", "WAL").map_err(sqlite)?;
        connection.pragma_update(None, "synchronous", "FULL").map_err(sqlite)?;
        if loaded.version() < SCHEMA_VERSION {
            update(&mut connection, &mut loaded, program).map_err(sqlite)?;
        }
        let file = file.to_owned();
        Ok(SqliteStore { file, connection: Some(connection), loaded, failed: false, _lock: lock })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.file
    }

    fn try_write(&mut self, step: &Step) -> Result<(), StoreError> {
        let prepared = prepare(&self.file, &mut self.loaded, step)?;
        let Some(connection) = &mut self.connection else {
            return Err(StoreError::Failed { file: self.file.clone() });
        };
        match write(connection, &mut self.loaded, prepared) {
            Ok(true) => Ok(()),
            Ok(false) => Err(StoreError::Overtaken { file: self.file.clone() }),
            Err(cause) => Err(StoreError::database(&self.file, cause)),
        }
    }

    /// Brings everything into the one file. With readers about, the log stays beside it until the
    /// next writer closes.
    fn finish(&mut self) -> rusqlite::Result<()> {
        let Some(connection) = self.connection.take() else { return Ok(()) };
        connection.flush_prepared_statement_cache();
        connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))?;
        connection.busy_timeout(std::time::Duration::ZERO)?;
        match connection.pragma_update(None, "journal_mode", "DELETE") {
            Err(cause) if !is_busy(&cause) => return Err(cause),
            _ => {}
        }
        connection.close().map_err(|(_, cause)| cause)
    }
}

impl Store for SqliteStore {
    fn site(&self) -> &Site {
        &self.loaded.site
    }

    fn write(&mut self, step: &Step) -> Result<(), StoreError> {
        if self.failed {
            return Err(StoreError::Failed { file: self.file.clone() });
        }
        if step.is_empty() {
            return Ok(());
        }
        self.failed = true;
        self.try_write(step)?;
        self.failed = false;
        Ok(())
    }

    fn close(mut self) -> Result<(), StoreError> {
        self.finish().map_err(|cause| StoreError::database(&self.file, cause))
    }
}

impl Drop for SqliteStore {
    fn drop(&mut self) {
        // Every step is on disk already; what fails here is tried again by the next writer.
        let _ = self.finish();
    }
}

fn is_busy(cause: &rusqlite::Error) -> bool {
    use rusqlite::ErrorCode::{DatabaseBusy, DatabaseLocked};
    matches!(cause.sqlite_error_code(), Some(DatabaseBusy | DatabaseLocked))
}

/// Makes an empty file under another name, then gives it its own: it is there whole or not at all.
fn write_empty(file: &Path, program: &str) -> Result<(), StoreError> {
    let temporary = beside(file, "-new");
    let cannot = |cause| StoreError::file(file, cause);
    for leftover in [temporary.clone(), beside(&temporary, "-journal")] {
        if leftover.exists() {
            std::fs::remove_file(&leftover).map_err(cannot)?;
        }
    }
    fill_empty(&temporary, program).map_err(|cause| StoreError::database(file, cause))?;
    std::fs::rename(&temporary, file).map_err(cannot)?;
    sync_folder(file).map_err(cannot)
}

pub(crate) fn fill_empty(file: &Path, program: &str) -> rusqlite::Result<()> {
    let mut connection = Connection::open(file)?;
    connection.pragma_update(None, "page_size", PAGE_SIZE)?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    let transaction = connection.transaction()?;
    let mut empty = Loaded::default();
    migrate(&transaction, &mut empty, program)?;
    empty.ledger.write_all(&transaction)?;
    transaction.commit()?;
    connection.close().map_err(|(_, cause)| cause)
}

/// A new name is on disk when its folder is.
fn sync_folder(file: &Path) -> std::io::Result<()> {
    if cfg!(unix) {
        let folder = file.parent().filter(|p| !p.as_os_str().is_empty());
        std::fs::File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}

/// Brings an older schema up to date, in one transaction.
fn update(connection: &mut Connection, loaded: &mut Loaded, program: &str) -> rusqlite::Result<()> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    migrate(&transaction, loaded, program)?;
    loaded.ledger.write(&transaction)?;
    transaction.commit()
}

/// Writes a step; false, and nothing written, when the journal does not end where it did.
fn write(
    connection: &mut Connection,
    loaded: &mut Loaded,
    prepared: Prepared,
) -> rusqlite::Result<bool> {
    let ledger = &mut loaded.ledger;
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    if read_journal_digest(&transaction)? != Some(ledger.journal) {
        return Ok(false);
    }
    for (table, cells) in &prepared.rows {
        ledger.put(&transaction, table, cells)?;
    }
    let patches = loaded.site.manifold.patches();
    for patch in prepared.patches {
        places::put(&transaction, &patches[patch.index()], loaded.islands[patch.index()])?;
    }
    let sql = "INSERT INTO changes VALUES (?, ?, ?, ?, ?)";
    for (kind, payload) in prepared.changes {
        let change = ledger.journal.rows;
        let before = ledger.journal.sum;
        let link = crate::table::chain(before, change, prepared.step, kind, &payload);
        let row = (change as i64, prepared.step as i64, kind, payload, link as i64);
        transaction.prepare_cached(sql)?.execute(row)?;
        ledger.link(link);
    }
    ledger.write(&transaction)?;
    transaction.commit()?;
    Ok(true)
}

/// A file as a reader sees it.
#[derive(Debug)]
pub struct SiteFile {
    /// What it holds.
    pub site: Site,
    /// Schema versions it has had, with the programs that wrote them; the last is the present one.
    pub versions: Vec<(i64, String)>,
    /// Changes in its journal.
    pub changes: u64,
}

/// Reads a file without a right to write to it, also while a writer is at work: what the last step
/// before left.
///
/// # Errors
/// [`StoreError`] says why not; [`StoreError::Damaged`] when any of it is not as it was written.
pub fn read(file: &Path) -> Result<SiteFile, StoreError> {
    check_header(file)?;
    let loaded = load(&for_reading(file)?, file)?;
    let changes = loaded.ledger.journal.rows;
    Ok(SiteFile { site: loaded.site, versions: loaded.versions, changes })
}

/// Checks everything that can be checked: what [`read`] checks, SQLite's own structures, and that
/// replaying the journal gives the same map bit by bit. Returns what is wrong.
///
/// # Errors
/// As [`read`].
pub fn verify(file: &Path) -> Result<Vec<Finding>, StoreError> {
    check_header(file)?;
    let connection = for_reading(file)?;
    let loaded = load(&connection, file)?;
    let sqlite = |cause| StoreError::database(file, cause);
    let _one_moment = connection.unchecked_transaction().map_err(sqlite)?;
    let mut findings = integrity(&connection).map_err(sqlite)?;
    findings.extend(replayed(&connection, &loaded).map_err(sqlite)?);
    if loaded.version() >= schema::WITH_PLACES {
        let patches = loaded.site.manifold.patches();
        findings.extend(places::problems(&connection, patches, &loaded.islands).map_err(sqlite)?);
    }
    Ok(findings)
}

/// SQLite's own check: pages, cells, indexes.
fn integrity(connection: &Connection) -> rusqlite::Result<Vec<Finding>> {
    let mut statement = connection.prepare("PRAGMA integrity_check")?;
    let lines: Vec<String> =
        statement.query_map([], |row| row.get(0))?.collect::<Result<_, _>>()?;
    let wrong = lines.into_iter().filter(|line| line != "ok");
    Ok(wrong.map(|problem| Finding { place: "database".into(), problem }).collect())
}

#[cfg(test)]
mod tests {
    // A test that cannot unwrap has failed.
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_full_disk_stops_the_writer_and_costs_nothing_written() {
        let name = format!("manifoldslam-store-full-{}.manifold", std::process::id());
        let file = std::env::temp_dir().join(name);
        let _ = std::fs::remove_file(&file);
        let mut store = SqliteStore::create(&file, "test").unwrap();
        let connection = store.connection.as_ref().unwrap();
        let sql = "PRAGMA max_page_count = 30";
        connection.query_row(sql, [], |row| row.get::<_, i64>(0)).unwrap();
        let step = |i: usize| {
            let entry = (format!("entry {i}"), "x".repeat(3000));
            Step { metadata: vec![entry], ..Step::default() }
        };
        let written = (0..100).take_while(|i| store.write(&step(*i)).is_ok()).count();
        assert!((3..30).contains(&written), "{written}");
        let error = store.write(&step(0)).unwrap_err();
        assert!(matches!(error, StoreError::Failed { .. }), "{error}");
        store.close().unwrap();
        let mut store = SqliteStore::open(&file, "test").unwrap();
        assert_eq!(store.site().metadata.len(), written);
        store.write(&step(written)).unwrap();
        store.close().unwrap();
        assert_eq!(read(&file).unwrap().site.metadata.len(), written + 1);
        assert_eq!(verify(&file).unwrap(), []);
        std::fs::remove_file(&file).unwrap();
    }
}
