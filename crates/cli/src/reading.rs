use anyhow::{Result, anyhow};
use logs::{CarmenReader, LogFile, LogInput, LogRecord, ReadOptions, ReadReport};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Scans that travel together.
const BATCH: usize = 32;
/// Batches that may wait; then the reader waits, so that memory stays bounded.
const WAITING: usize = 16;

/// A log that is read and decompressed on a thread of its own while its scans are being used.
pub struct Reading {
    receiver: Receiver<Vec<LogRecord>>,
    thread: JoinHandle<(ReadReport, Duration)>,
    position: Arc<AtomicU64>,
}

impl Reading {
    /// Starts reading an open file.
    pub fn of_file(file: LogFile, path: &Path, options: ReadOptions) -> Result<Self> {
        let position = file.position;
        let reader = CarmenReader::new(file.input, options).with_name(path);
        Self::start(reader, position)
    }

    /// Starts reading from memory.
    pub fn of_text(text: Vec<u8>, name: &Path, options: ReadOptions) -> Result<Self> {
        let input: LogInput = Box::new(std::io::Cursor::new(text));
        Self::start(CarmenReader::new(input, options).with_name(name), Arc::default())
    }

    fn start(mut reader: CarmenReader<LogInput>, position: Arc<AtomicU64>) -> Result<Self> {
        let (sender, receiver) = sync_channel(WAITING);
        let work = move || {
            let mut busy = Duration::ZERO;
            loop {
                let start = Instant::now();
                let batch: Vec<LogRecord> = reader.by_ref().take(BATCH).collect();
                busy += start.elapsed();
                // Nobody takes the scans any more when mapping has failed.
                if batch.is_empty() || sender.send(batch).is_err() {
                    return (reader.finish(), busy);
                }
            }
        };
        let thread = std::thread::Builder::new().name("reading".into()).spawn(work)?;
        Ok(Reading { receiver, thread, position })
    }

    /// The scans, in the log's order.
    pub fn records(&self) -> impl Iterator<Item = LogRecord> {
        self.receiver.iter().flatten()
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
