//! The schema, its versions, and how older files become new ones.

use crate::error::{Finding, StoreError};
use crate::loading::Loaded;
use crate::places;
use crate::rows::{OBSERVATIONS, VERSIONS, version_cells};
use rusqlite::{Connection, OptionalExtension};
use std::path::Path;
use std::sync::OnceLock;

/// Marks the file as ours (SQLite's header, bytes 68 to 71): `MfSL`.
pub(crate) const APPLICATION_ID: u32 = u32::from_be_bytes(*b"MfSL");
/// Schema version of the files written by this program.
pub const SCHEMA_VERSION: i64 = 3;
/// Bytes of a page. All files have the same, so that a damaged header can be replaced.
pub(crate) const PAGE_SIZE: u32 = 4096;

/// What each version added to the one before; the first makes a file out of nothing.
const SQL: [&str; SCHEMA_VERSION as usize] =
    [include_str!("schema-1.sql"), include_str!("schema-2.sql"), include_str!("schema-3.sql")];
/// The version that brought `patch_places`.
pub(crate) const WITH_PLACES: i64 = 2;
/// The version that brought `observations`.
pub(crate) const WITH_OBSERVATIONS: i64 = 3;

/// Brings a database from one version to the newest; the caller holds the transaction.
pub(crate) fn migrate(
    connection: &Connection,
    loaded: &mut Loaded,
    program: &str,
) -> rusqlite::Result<()> {
    let from = loaded.version();
    for (version, sql) in (1..).zip(SQL).skip(from as usize) {
        connection.execute_batch(sql)?;
        loaded.ledger.put(connection, &VERSIONS, &version_cells(version, program))?;
        connection.pragma_update(None, "user_version", version)?;
        loaded.versions.push((version, program.to_owned()));
        if version == WITH_OBSERVATIONS {
            loaded.ledger.begin(&OBSERVATIONS);
        }
        if version == WITH_PLACES {
            for (patch, island) in loaded.site.manifold.patches().iter().zip(&loaded.islands) {
                places::put(connection, patch, *island)?;
            }
        }
    }
    Ok(())
}

/// The file's schema version, when it is one that this program knows.
pub(crate) fn version(connection: &Connection, file: &Path) -> Result<i64, StoreError> {
    let sqlite = |cause| StoreError::database(file, cause);
    let pragma = |name| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
    let id = pragma("application_id").map_err(sqlite)?;
    if id as u32 != APPLICATION_ID {
        return Err(StoreError::foreign(file, format!("application id {:#010x}", id as u32)));
    }
    let version = pragma("user_version").map_err(sqlite)?;
    let program = "SELECT program FROM versions WHERE version = ? \
                   AND version = (SELECT max(version) FROM versions)";
    let program: Option<String> =
        connection.query_row(program, [version], |row| row.get(0)).optional().map_err(sqlite)?;
    match program {
        Some(program) if version > SCHEMA_VERSION => Err(StoreError::Newer {
            file: file.to_owned(),
            version,
            known: SCHEMA_VERSION,
            program,
        }),
        Some(_) if version >= 1 => Ok(version),
        _ => {
            let problem = format!("version {version} is not the one that the table `versions` has");
            let findings = vec![Finding { place: "header".into(), problem }];
            Err(StoreError::Damaged { file: file.to_owned(), findings })
        }
    }
}

/// Type, name, table and text of everything in the schema.
type Entries = Vec<(String, String, String, Option<String>)>;

fn entries(connection: &Connection) -> rusqlite::Result<Entries> {
    let sql = "SELECT type, name, tbl_name, sql FROM sqlite_schema ORDER BY name, type";
    let mut statement = connection.prepare(sql)?;
    let rows =
        statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))?;
    rows.collect()
}

/// The schema that files are written in.
static NEWEST: OnceLock<Entries> = OnceLock::new();

/// The schema of a version, in an empty database.
fn expected(version: i64) -> rusqlite::Result<Entries> {
    let model = Connection::open_in_memory()?;
    SQL.iter().take(version as usize).try_for_each(|sql| model.execute_batch(sql))?;
    entries(&model)
}

/// Said of what should be in the schema and is not.
pub(crate) const MISSING: &str = "is missing or altered";

/// What differs from the schema of a version: nothing is added, nothing is missing.
pub(crate) fn problems(connection: &Connection, version: i64) -> rusqlite::Result<Vec<Finding>> {
    let expected = match version {
        SCHEMA_VERSION => NEWEST.get_or_init(|| expected(version).unwrap_or_default()),
        older => &expected(older)?,
    };
    let found = entries(connection)?;
    let differing = expected.iter().filter(|e| !found.contains(e));
    let foreign = found.iter().filter(|e| !expected.contains(e));
    Ok(differing
        .map(|e| (e, MISSING))
        .chain(foreign.map(|e| (e, "does not belong there")))
        .map(|(e, what)| Finding {
            place: "schema".into(),
            problem: format!("{} `{}` {what}", e.0, e.1),
        })
        .collect())
}

/// Pages of an empty file of the first version: one for the schema, one for each table.
pub(crate) const FIRST_PAGES: usize = 14;

/// The first page of an empty file of the first version. Its tables stand at the same pages in
/// every file: later versions add theirs behind them.
pub(crate) fn first_page() -> rusqlite::Result<Vec<u8>> {
    let mut connection = Connection::open_in_memory()?;
    connection.pragma_update(None, "page_size", PAGE_SIZE)?;
    connection.pragma_update(None, "application_id", APPLICATION_ID)?;
    connection.execute_batch(SQL[0])?;
    let bytes = connection.serialize(rusqlite::MAIN_DB)?;
    Ok(bytes[..PAGE_SIZE as usize].to_vec())
}

#[cfg(test)]
mod tests {
    // A test that cannot unwrap has failed.
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn tables_of_the_first_version_have_their_pages() {
        assert_eq!(first_page().unwrap()[28..32], (FIRST_PAGES as u32).to_be_bytes());
    }

    #[test]
    fn tables_have_the_columns_that_rows_are_written_in() {
        let connection = Connection::open_in_memory().unwrap();
        migrate(&connection, &mut Loaded::default(), "test").unwrap();
        for table in crate::rows::STATE {
            let sql = format!("SELECT * FROM {}", table.name);
            let statement = connection.prepare(&sql).unwrap();
            let mut expected = table.columns.to_vec();
            expected.extend(["negative_zeros", "checksum"]);
            assert_eq!(statement.column_names().collect::<Vec<_>>(), expected, "{}", table.name);
        }
    }
}
