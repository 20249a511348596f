use crate::{DropReason, DroppedLine, LogError, TableReport};
use std::collections::BTreeMap;

/// Dropped lines that are kept one by one; beyond this they are counted only.
pub(crate) const MAX_LISTED: usize = 100;
/// Names of skipped messages that are told apart.
const MAX_NAMES: usize = 64;

/// What a reader made of a log: the other half of its answer, beside the records.
#[derive(Debug, Default)]
pub struct ReadReport {
    /// Lines read.
    pub lines: u64,
    /// Scans handed out.
    pub scans: u64,
    /// Scans left out because the line before told the same scan under another name.
    pub duplicates: u64,
    /// Scans whose stamp lies before the stamp of the scan read before them. They are kept.
    pub stamps_back: u64,
    /// Beams without a usable reading (NaN, negative) in the scans handed out.
    pub invalid_beams: u64,
    /// Landmarks in the scans handed out that the log itself tells of.
    pub sightings: u64,
    /// What became of the landmarks in a table beside the log, where there is one.
    pub landmark_table: Option<TableReport>,
    /// Messages that are not scans, by name.
    pub skipped: BTreeMap<String, u64>,
    /// The first dropped lines with their reasons.
    pub dropped: Vec<DroppedLine>,
    /// All dropped lines, the listed ones included.
    pub dropped_count: u64,
    /// Set when reading stopped before the end of the file.
    pub failure: Option<LogError>,
}

impl ReadReport {
    /// True when something in the log was lost: the run must not end with exit code 0.
    pub fn is_lossy(&self) -> bool {
        let table = self.landmark_table.as_ref().is_some_and(|table| table.dropped_count > 0);
        self.dropped_count > 0 || self.failure.is_some() || table
    }

    pub(crate) fn drop_line(&mut self, line: u64, field: Option<usize>, reason: DropReason) {
        self.dropped_count += 1;
        if self.dropped.len() < MAX_LISTED {
            self.dropped.push(DroppedLine { line, field, reason });
        }
    }

    pub(crate) fn skip_message(&mut self, name: &str) {
        if let Some(count) = self.skipped.get_mut(name) {
            *count += 1;
        } else if self.skipped.len() < MAX_NAMES {
            self.skipped.insert(name.to_owned(), 1);
        } else {
            *self.skipped.entry("others".to_owned()).or_default() += 1;
        }
    }
}
