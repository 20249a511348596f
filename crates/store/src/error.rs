use manifold::{ManifoldError, PatchId};
use std::fmt;
use std::path::{Path, PathBuf};

/// Why a manifold file could not be opened or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The file cannot be opened, created or given its name.
    #[error("{}: {cause}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What the operating system says.
        cause: std::io::Error,
    },
    /// The file is something else.
    #[error("{}: not a manifold file: {reason}", file.display())]
    Foreign {
        /// The file.
        file: PathBuf,
        /// How that shows.
        reason: String,
    },
    /// The file was written by a newer program.
    #[error(
        "{}: written in schema version {version}, this program knows versions up to {known}; \
         open it with manifoldslam {program} or newer",
        file.display()
    )]
    Newer {
        /// The file.
        file: PathBuf,
        /// Its schema version.
        version: i64,
        /// The newest version known here.
        known: i64,
        /// The program that first wrote this version into the file.
        program: String,
    },
    /// What the file holds is not what was written.
    #[error("{}: damaged: {}; `manifoldslam salvage` saves what can be saved",
        file.display(), Findings(findings))]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What was found, in the order of finding.
        findings: Vec<Finding>,
    },
    /// Another program has the file open for writing.
    #[error("{}: another program is writing to this file", file.display())]
    Locked {
        /// The file.
        file: PathBuf,
    },
    /// Another program has written to the file since it was opened here.
    #[error("{}: another program has written to this file meanwhile; open it again", file.display())]
    Overtaken {
        /// The file.
        file: PathBuf,
    },
    /// A step before has failed: the file holds everything up to that step.
    #[error("{}: a step before could not be written; open the file again", file.display())]
    Failed {
        /// The file.
        file: PathBuf,
    },
    /// A step does not follow on what the file holds.
    #[error("{}: {cause}", file.display())]
    OutOfOrder {
        /// The file.
        file: PathBuf,
        /// What the manifold says.
        cause: ManifoldError,
    },
    /// A number is NaN or infinite.
    #[error("{}: a number in `{table}` is NaN or infinite", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// The table it was meant for.
        table: &'static str,
    },
    /// A scan that could not be had back bit by bit.
    #[error("{}: the scan of patch {} has more than 65,536 beams or breaks its own limits",
        file.display(), patch.0)]
    Scan {
        /// The file.
        file: PathBuf,
        /// The patch.
        patch: PatchId,
    },
    /// The database refuses: disk full, no permission, read error.
    #[error("{}: {cause}", file.display())]
    Database {
        /// The file.
        file: PathBuf,
        /// What SQLite says.
        cause: rusqlite::Error,
    },
}

impl StoreError {
    pub(crate) fn file(file: &Path, cause: std::io::Error) -> Self {
        StoreError::File { file: file.to_owned(), cause }
    }

    pub(crate) fn foreign(file: &Path, reason: impl Into<String>) -> Self {
        StoreError::Foreign { file: file.to_owned(), reason: reason.into() }
    }

    /// What SQLite says, sorted: a file that is no database, one that is damaged, anything else.
    pub(crate) fn database(file: &Path, cause: rusqlite::Error) -> Self {
        use rusqlite::ErrorCode;
        match cause.sqlite_error_code() {
            Some(ErrorCode::NotADatabase) => Self::foreign(file, "no SQLite database"),
            Some(ErrorCode::DatabaseCorrupt) => {
                let finding = Finding { place: "database".into(), problem: cause.to_string() };
                StoreError::Damaged { file: file.to_owned(), findings: vec![finding] }
            }
            _ => StoreError::Database { file: file.to_owned(), cause },
        }
    }
}

/// Something in a file that is not as it was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The table, or the part of the file.
    pub place: String,
    /// What is wrong there.
    pub problem: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.problem)
    }
}

/// Findings that are told one by one; the rest is counted.
const TOLD: usize = 5;

struct Findings<'a>(&'a [Finding]);

impl fmt::Display for Findings<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, finding) in self.0.iter().take(TOLD).enumerate() {
            write!(f, "{}{finding}", if i > 0 { "; " } else { "" })?;
        }
        match self.0.len().saturating_sub(TOLD) {
            0 => Ok(()),
            more => write!(f, "; and {more} more"),
        }
    }
}
