//! Opens database files: for writing, for reading beside a writer, and where nothing can be
//! written.

use crate::error::StoreError;
use crate::lock::beside;
use crate::schema::{APPLICATION_ID, PAGE_SIZE};
use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::Duration;

/// How long to wait for another program that holds a lock for a moment: a reader that restores the
/// log of a killed writer, a writer that closes.
const BUSY: Duration = Duration::from_secs(5);
const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// Looks at the first bytes: what is refused here is refused with better words than SQLite has.
pub(crate) fn check_header(file: &Path) -> Result<(), StoreError> {
    let cannot = |cause| StoreError::file(file, cause);
    let mut open = File::open(file).map_err(cannot)?;
    let size = open.metadata().map_err(cannot)?;
    if size.is_dir() {
        return Err(cannot(std::io::Error::other("is a folder, not a file")));
    }
    let mut header = Vec::new();
    open.by_ref().take(100).read_to_end(&mut header).map_err(cannot)?;
    let word = |at: usize| u32::from_be_bytes([0, 1, 2, 3].map(|i| header[at + i]));
    let reason = match header.len() {
        0 => "the file is empty".into(),
        n if n < 100 => format!("only {n} bytes"),
        _ if !header.starts_with(MAGIC) => "no SQLite database".into(),
        _ if word(68) != APPLICATION_ID => {
            format!("an SQLite database with application id {:#010x}", word(68))
        }
        _ => {
            return check_size(file, u64::from(word(28)) * u64::from(PAGE_SIZE), size.len());
        }
    };
    Err(StoreError::foreign(file, reason))
}

/// Refuses a file that is shorter than its header says, unless a log beside it has the rest.
fn check_size(file: &Path, expected: u64, found: u64) -> Result<(), StoreError> {
    if found >= expected || has_log(file) {
        return Ok(());
    }
    let finding = crate::Finding {
        place: "file".into(),
        problem: format!("truncated: {found} bytes of {expected}"),
    };
    Err(StoreError::Damaged { file: file.to_owned(), findings: vec![finding] })
}

/// True when a writer is at work, or was killed: what it wrote stands in part in a log.
pub(crate) fn has_log(file: &Path) -> bool {
    ["-wal", "-journal"]
        .iter()
        .any(|ending| std::fs::metadata(beside(file, ending)).is_ok_and(|log| log.len() > 0))
}

/// For the one writer.
pub(crate) fn for_writing(file: &Path) -> Result<Connection, StoreError> {
    let connection = open(file, OpenFlags::SQLITE_OPEN_READ_WRITE, false)
        .map_err(|cause| StoreError::database(file, cause))?;
    if connection.is_readonly(rusqlite::MAIN_DB).unwrap_or(true) {
        let denied = std::io::Error::from(std::io::ErrorKind::PermissionDenied);
        return Err(StoreError::file(file, denied));
    }
    Ok(connection)
}

/// For readers, beside a writer or alone. Nothing in the file is changed, but for the leftovers of
/// a writer that was killed; where even the folder cannot be written, the file alone is read.
pub(crate) fn for_reading(file: &Path) -> Result<Connection, StoreError> {
    let first = open(file, OpenFlags::SQLITE_OPEN_READ_WRITE, false).and_then(quiet);
    let connection = match first {
        Err(_) if !has_log(file) => {
            open(file, OpenFlags::SQLITE_OPEN_READ_ONLY, true).and_then(quiet)
        }
        other => other,
    };
    connection.map_err(|cause| StoreError::database(file, cause))
}

/// Forbids writing, and shows whether reading works at all.
fn quiet(connection: Connection) -> rusqlite::Result<Connection> {
    connection.pragma_update(None, "query_only", true)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)?;
    connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))?;
    Ok(connection)
}

/// `immutable`: nobody else writes, and neither logs nor locks are needed.
fn open(file: &Path, access: OpenFlags, immutable: bool) -> rusqlite::Result<Connection> {
    let flags = access | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
    let connection = if immutable {
        Connection::open_with_flags(format!("file:{}?immutable=1", escaped(file)), flags)?
    } else {
        Connection::open_with_flags(file, access | OpenFlags::SQLITE_OPEN_NO_MUTEX)?
    };
    connection.busy_timeout(BUSY)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
    connection.pragma_update(None, "cell_size_check", true)?;
    connection.set_prepared_statement_cache_capacity(64);
    Ok(connection)
}

/// A path as part of a URI.
fn escaped(file: &Path) -> String {
    let path = file.to_string_lossy();
    path.replace('%', "%25").replace('?', "%3f").replace('#', "%23")
}
