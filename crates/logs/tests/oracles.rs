//! What the readers must hold to: the formats' meaning, round trips, and any input whatsoever.

// A test that cannot unwrap has failed.
#![allow(clippy::unwrap_used)]

#[path = "oracles/attitude.rs"]
mod attitude;
#[path = "oracles/carmen.rs"]
mod carmen;
#[path = "oracles/compressed.rs"]
mod compressed;
#[path = "oracles/cut.rs"]
mod cut;
#[path = "oracles/damage.rs"]
mod damage;
#[path = "oracles/landmarks.rs"]
mod landmarks;
#[path = "oracles/real.rs"]
mod real;
#[path = "oracles/tum.rs"]
mod tum;

use manifoldslam_logs::{CarmenReader, LogRecord, ReadOptions, ReadReport};

/// Reads a whole log from memory.
fn read(text: impl AsRef<[u8]>) -> (Vec<LogRecord>, ReadReport) {
    read_with(text, ReadOptions::default())
}

fn read_with(text: impl AsRef<[u8]>, options: ReadOptions) -> (Vec<LogRecord>, ReadReport) {
    let mut reader = CarmenReader::new(text.as_ref(), options);
    let records = reader.by_ref().collect();
    (records, reader.finish())
}
