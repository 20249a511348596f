//! Writes a manifold file on a thread of its own.

use anyhow::{Context, Result, anyhow};
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{SystemTime, UNIX_EPOCH};
use store::{COMMIT_EVERY, Recorder, SqliteStore, StoreError};

/// Jobs that may wait; then who has more waits too, so that memory stays bounded.
const WAITING: usize = 64;

type Job = Box<dyn FnOnce(&mut Recorder<SqliteStore>) -> Result<(), StoreError> + Send>;

/// A manifold file that is being written beside the mapping.
pub struct SiteWriter {
    jobs: SyncSender<Job>,
    thread: JoinHandle<Result<(), StoreError>>,
}

impl SiteWriter {
    /// Begins to write a new file.
    pub fn create(file: &Path) -> Result<Self> {
        Self::start(SqliteStore::create(file, env!("CARGO_PKG_VERSION"))?)
    }

    /// Goes on with an open file.
    pub fn start(store: SqliteStore) -> Result<Self> {
        let (jobs, waiting) = sync_channel::<Job>(WAITING);
        let work = move || {
            let mut recorder = Recorder::new(store, COMMIT_EVERY);
            for job in waiting {
                job(&mut recorder)?;
            }
            recorder.commit("scans", now_unix_ns())?;
            recorder.close()
        };
        let thread = std::thread::Builder::new().name("writing".into()).spawn(work)?;
        Ok(SiteWriter { jobs, thread })
    }

    /// Has something written, in turn. What goes wrong shows in [`SiteWriter::close`].
    pub fn write(
        &self,
        job: impl FnOnce(&mut Recorder<SqliteStore>) -> Result<(), StoreError> + Send + 'static,
    ) {
        // The thread has ended where a job before has failed.
        let _ = self.jobs.send(Box::new(job));
    }

    /// Waits until everything is written and closes the file.
    pub fn close(self) -> Result<()> {
        drop(self.jobs);
        let ended = self.thread.join().map_err(|_| anyhow!("the writing thread has failed"))?;
        ended.context("cannot write the manifold file")
    }
}

/// The time, nanoseconds since 1970.
pub fn now_unix_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
