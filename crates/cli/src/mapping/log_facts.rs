use logs::ReadReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Dropped lines that a message shows.
const SHOWN: usize = 5;

/// What a reader made of a log, in figures: told in `metrics.json` and kept in the manifold file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LogFacts {
    /// From the least to the greatest stamp.
    pub duration_secs: f64,
    /// Lines in it.
    pub lines: u64,
    /// Scans mapped.
    pub scans: u64,
    /// Scans told twice.
    pub duplicate_scans: u64,
    /// Stamps that jump back.
    pub stamps_back: u64,
    /// Beams without a usable reading.
    pub invalid_beams: u64,
    /// Landmarks seen, those of the table beside the log included.
    pub sightings: u64,
    /// The table of landmarks beside the log, where there is one.
    pub landmark_table: Option<String>,
    /// Messages that are not scans.
    pub skipped_messages: BTreeMap<String, u64>,
    /// Lines that could not be used.
    pub dropped_lines: u64,
    /// The first of them, with reasons.
    pub dropped: Vec<String>,
    /// Why reading stopped early, if it did.
    pub failure: Option<String>,
}

impl LogFacts {
    /// Puts a reader's report into figures.
    pub fn new(report: &ReadReport, duration_secs: f64) -> Self {
        let table = report.landmark_table.as_ref();
        let rows = table
            .into_iter()
            .flat_map(|t| t.dropped.iter().map(|row| format!("{}: {row}", t.file.display())));
        LogFacts {
            duration_secs,
            lines: report.lines,
            scans: report.scans,
            duplicate_scans: report.duplicates,
            stamps_back: report.stamps_back,
            invalid_beams: report.invalid_beams,
            sightings: report.sightings + table.map_or(0, |t| t.sightings),
            landmark_table: table.map(|t| t.file.display().to_string()),
            skipped_messages: report.skipped.clone(),
            dropped_lines: report.dropped_count + table.map_or(0, |t| t.dropped_count),
            dropped: report.dropped.iter().map(ToString::to_string).chain(rows).collect(),
            failure: report.failure.as_ref().map(ToString::to_string),
        }
    }

    /// True when something in the log was lost.
    pub fn is_lossy(&self) -> bool {
        self.dropped_lines > 0 || self.failure.is_some()
    }

    /// The first things that were wrong with a log of which no scan could be used, for a message.
    pub fn first_problems(&self) -> String {
        let mut text = String::new();
        for problem in self.dropped.iter().take(SHOWN) {
            text.push_str(&format!("\n  {problem}"));
        }
        if self.dropped_lines > SHOWN as u64 {
            text.push_str(&format!(
                "\n  and {} more dropped lines",
                self.dropped_lines - SHOWN as u64
            ));
        }
        if let Some(failure) = &self.failure {
            text.push_str(&format!("\n  {failure}"));
        }
        if text.is_empty() {
            text = format!(": none of its {} lines is a laser message", self.lines);
        }
        text
    }
}
