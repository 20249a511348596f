//! Readers and writers: CARMEN logs, TUM trajectories, g2o pose graphs, true relations.
//!
//! Parsers take any text and never panic; memory is bounded whatever the input. Readers of sensor
//! logs return what they could read and a report of what they left out ([`ReadReport`]); readers of
//! results (trajectories) are strict and fail with file, line and field ([`LogError`]).
//! Only [`LogFile`] knows of files. [`Cut`] makes several robots' logs of one.
//!
//! ```
//! use manifoldslam_logs::{CarmenReader, ReadOptions};
//! let log = "ODOM 0 0 0 0 0 0 1.5 host 0\nFLASER 2 1.0 2.0 0 0 0 0 0 0 1.50 host 0\n";
//! let records: Vec<_> = CarmenReader::new(log.as_bytes(), ReadOptions::default()).collect();
//! assert_eq!(records[0].stamp_text, "1.50");
//! ```

mod attitude_line;
mod carmen;
mod carmen_line;
mod cut;
mod error;
pub mod g2o;
mod input;
mod landmark_columns;
mod landmark_line;
mod landmark_table;
mod lines;
mod mounting;
mod number;
mod record;
mod relations;
mod report;
mod sightings;
mod tum;

pub use carmen::{CarmenReader, ReadOptions};
pub use cut::{Cut, CutReport, Piece, shares};
pub use error::{DropReason, DroppedLine, LogError};
pub use input::{LogFile, LogInput, decompress};
pub use landmark_table::{LandmarkTable, TableReport};
pub use record::LogRecord;
pub use relations::{TrueRelation, open_relations, read_relations};
pub use report::ReadReport;
pub use tum::{TumPose, open_tum, read_tum, write_tum};
