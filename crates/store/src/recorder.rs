use crate::error::StoreError;
use crate::observations::{ObservationBlock, TakenScan};
use crate::site::{RobotLog, Site, Step, TrackedScan};
use crate::store::Store;
use manifold::Change;
use sensing::RobotId;

/// Changes and scans that wait for each other by default. A step costs some page writes and a wait
/// for the disk, milliseconds in all; what waits is lost when the program is killed.
pub const COMMIT_EVERY: usize = 256;

/// Gathers what a mapper brings forth and writes it in steps: by count, since it reads no clock.
///
/// ```no_run
/// # use manifoldslam_store::{Recorder, SqliteStore, StoreError};
/// # fn f(mut map: manifold::Manifold, now: i64) -> Result<(), StoreError> {
/// let store = SqliteStore::create("site.manifold".as_ref(), env!("CARGO_PKG_VERSION"))?;
/// let mut recorder = Recorder::new(store, 256);
/// recorder.record(map.take_journal(), [], now)?;
/// recorder.set("state", "finished");
/// recorder.commit("refit", now)?;
/// recorder.close()
/// # }
/// ```
#[derive(Debug)]
pub struct Recorder<S: Store> {
    store: S,
    commit_every: usize,
    waiting: Step,
    /// Scans that wait to be packed together.
    taken: Vec<(RobotId, usize, TakenScan)>,
}

impl<S: Store> Recorder<S> {
    /// Writes into a store, a step for every `commit_every` changes and scans or so.
    pub fn new(store: S, commit_every: usize) -> Self {
        Recorder { store, commit_every, waiting: Step::default(), taken: Vec::new() }
    }

    /// What is written, without what waits.
    pub fn site(&self) -> &Site {
        self.store.site()
    }

    /// Notes which log a robot recorded; the robot itself joins by a change.
    pub fn set_log(&mut self, log: RobotLog) {
        self.waiting.logs.push(log);
    }

    /// Sets an entry of the metadata.
    pub fn set(&mut self, key: &str, value: &str) {
        self.waiting.metadata.push((key.to_owned(), value.to_owned()));
    }

    /// Takes what belongs into one step however large it is: nothing is written before
    /// [`Recorder::commit`].
    pub fn add(
        &mut self,
        changes: impl IntoIterator<Item = Change>,
        scans: impl IntoIterator<Item = (RobotId, usize, TrackedScan)>,
    ) {
        self.waiting.changes.extend(changes);
        self.waiting.scans.extend(scans);
    }

    /// Takes changes in the order they happened, and scans by robot and place in its log, which may
    /// hang on patches of these changes. `now_unix_ns` is nanoseconds since 1970.
    ///
    /// # Errors
    /// Those of [`Store::write`], when a step is due.
    pub fn record(
        &mut self,
        changes: impl IntoIterator<Item = Change>,
        scans: impl IntoIterator<Item = (RobotId, usize, TrackedScan)>,
        now_unix_ns: i64,
    ) -> Result<(), StoreError> {
        self.add(changes, scans);
        if self.waiting.changes.len() + self.waiting.scans.len() < self.commit_every {
            return Ok(());
        }
        self.commit("scans", now_unix_ns)
    }

    /// Takes scans as they were taken, by robot and place in its log; [`Recorder::record`] tells
    /// where they were found.
    pub fn keep(&mut self, scans: impl IntoIterator<Item = (RobotId, usize, TakenScan)>) {
        self.taken.extend(scans);
    }

    /// Writes what waits as a step.
    ///
    /// # Errors
    /// Those of [`Store::write`].
    pub fn commit(&mut self, note: &str, now_unix_ns: i64) -> Result<(), StoreError> {
        self.waiting.observations.extend(blocks(std::mem::take(&mut self.taken)));
        let step = std::mem::take(&mut self.waiting);
        self.store.write(&Step { note: note.to_owned(), time_unix_ns: now_unix_ns, ..step })
    }

    /// Closes the store. What waits is not written: say [`Recorder::commit`] before.
    ///
    /// # Errors
    /// Those of [`Store::close`].
    pub fn close(self) -> Result<(), StoreError> {
        self.store.close()
    }
}

/// Scans that follow on one another, packed together. One that could not be had back bit by bit
/// (more beams than any scanner has) is not kept: its place in the trajectory is.
fn blocks(taken: Vec<(RobotId, usize, TakenScan)>) -> Vec<ObservationBlock> {
    let mut blocks = Vec::new();
    let mut rest = &taken[..];
    while let Some(&(robot, first, _)) = rest.first() {
        let follows = |(i, scan): &(usize, &(RobotId, usize, TakenScan))| {
            scan.0 == robot && scan.1 == first + i && *i < SCANS_IN_A_BLOCK
        };
        let count = rest.iter().enumerate().take_while(follows).count();
        let scans: Vec<TakenScan> = rest[..count].iter().map(|scan| scan.2.clone()).collect();
        match ObservationBlock::pack(robot, first, &scans) {
            Some(block) => blocks.push(block),
            None => blocks.extend((first..).zip(&scans).filter_map(|(i, scan)| {
                ObservationBlock::pack(robot, i, std::slice::from_ref(scan))
            })),
        }
        rest = &rest[count..];
    }
    blocks
}

/// What is damaged costs no more scans than this.
const SCANS_IN_A_BLOCK: usize = 256;
