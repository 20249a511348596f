//! One writer at a time.

use crate::error::StoreError;
use std::ffi::OsString;
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

/// The right to write to a manifold file: a lock on a file beside it, which the operating system
/// takes back when the program ends, however it ends.
///
/// It is there for a clear message. What keeps two writers from spoiling the file is that a step is
/// one transaction, which begins by looking whether the journal still ends where it did.
#[derive(Debug)]
pub(crate) struct WriterLock {
    path: PathBuf,
    _file: File,
}

impl WriterLock {
    pub fn take(target: &Path) -> Result<Self, StoreError> {
        let path = beside(target, "-lock");
        let cannot = |cause| StoreError::file(&path, cause);
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(cannot)?;
        match file.try_lock() {
            Ok(()) => Ok(WriterLock { path, _file: file }),
            Err(TryLockError::WouldBlock) => Err(StoreError::Locked { file: target.to_owned() }),
            Err(TryLockError::Error(cause)) => Err(cannot(cause)),
        }
    }
}

impl Drop for WriterLock {
    fn drop(&mut self) {
        // Nobody minds a lock file that stays behind.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The path with something appended to its name.
pub(crate) fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(ending);
    PathBuf::from(name)
}
