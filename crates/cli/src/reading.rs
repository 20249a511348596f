use anyhow::{Result, anyhow};
use logs::{CarmenReader, LandmarkTable, LogFile, LogInput, LogRecord, ReadOptions, ReadReport};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Scans that travel together.
const BATCH: usize = 32;
/// With fewer batches waiting the reader is behind and leaves the preparation to the user.
const ENOUGH: usize = 4;
/// Batches that may wait; then the reader waits, so that memory stays bounded.
const WAITING: usize = 16;

/// A log that is read, decompressed and prepared on a thread of its own while its scans are being
/// used.
///
/// `T` is what the preparation makes of each scan; it is told whether the reader is behind its
/// user.
pub struct Reading<T> {
    receiver: Receiver<Vec<T>>,
    thread: JoinHandle<(ReadReport, Duration)>,
    position: Arc<AtomicU64>,
    waiting: Arc<AtomicUsize>,
}

impl<T: Send + 'static> Reading<T> {
    /// Starts reading an open file, with the landmarks in a table beside it.
    pub fn of_file(
        file: LogFile,
        path: &Path,
        options: ReadOptions,
        prepare: impl FnMut(LogRecord, bool) -> T + Send + 'static,
    ) -> Result<Self> {
        let position = file.position;
        let reader = CarmenReader::new(file.input, options).with_name(path);
        Self::start(reader, LandmarkTable::beside(path)?, position, prepare)
    }

    /// Starts reading from memory.
    pub fn of_text(
        text: Vec<u8>,
        name: &Path,
        options: ReadOptions,
        prepare: impl FnMut(LogRecord, bool) -> T + Send + 'static,
    ) -> Result<Self> {
        let input: LogInput = Box::new(std::io::Cursor::new(text));
        let reader = CarmenReader::new(input, options).with_name(name);
        Self::start(reader, None, Arc::default(), prepare)
    }

    fn start(
        mut reader: CarmenReader<LogInput>,
        mut landmarks: Option<LandmarkTable>,
        position: Arc<AtomicU64>,
        mut prepare: impl FnMut(LogRecord, bool) -> T + Send + 'static,
    ) -> Result<Self> {
        let (sender, receiver) = sync_channel(WAITING);
        let waiting = Arc::new(AtomicUsize::new(0));
        let counter = Arc::clone(&waiting);
        let work = move || {
            let mut busy = Duration::ZERO;
            loop {
                let start = Instant::now();
                let behind = counter.load(Ordering::Relaxed) < ENOUGH;
                let scans = reader.by_ref().take(BATCH);
                let with_landmarks = |mut record: LogRecord| {
                    if let Some(table) = &mut landmarks {
                        table.give(&mut record);
                    }
                    prepare(record, behind)
                };
                let batch: Vec<T> = scans.map(with_landmarks).collect();
                busy += start.elapsed();
                counter.fetch_add(1, Ordering::Relaxed);
                // Nobody takes the scans any more when mapping has failed.
                if batch.is_empty() || sender.send(batch).is_err() {
                    let landmark_table = landmarks.map(LandmarkTable::finish);
                    return (ReadReport { landmark_table, ..reader.finish() }, busy);
                }
            }
        };
        let thread = std::thread::Builder::new().name("reading".into()).spawn(work)?;
        Ok(Reading { receiver, thread, position, waiting })
    }

    /// The scans, in the log's order.
    pub fn records(&self) -> impl Iterator<Item = T> {
        let taken = |_: &Vec<T>| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        };
        self.receiver.iter().inspect(taken).flatten()
    }

    /// Bytes taken from disk so far.
    pub fn position(&self) -> u64 {
        self.position.load(Ordering::Relaxed)
    }

    /// What the reader made of the log, and the time it spent.
    pub fn finish(self) -> Result<(ReadReport, Duration)> {
        drop(self.receiver);
        self.thread.join().map_err(|_| anyhow!("the reading thread has failed"))
    }
}
