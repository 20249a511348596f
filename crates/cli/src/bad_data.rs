//! What is told of data that went bad.

use crate::mapping::MappedRobot;
use crate::metrics::Metrics;
use crate::terminal::counted;
use serde::Serialize;
use slam::{BadStretch, Fault};

/// Scans that were left out of the map.
#[derive(Clone, Debug, Serialize)]
pub struct BadData {
    /// What was noticed.
    pub fault: Fault,
    /// Index of the first scan that is left out.
    pub first_scan: usize,
    /// How many are.
    pub scans: usize,
    /// Stamp of the first of them, as in the log.
    pub from_secs: String,
    /// Stamp of the last.
    pub to_secs: String,
    /// The map goes on behind on the same island: odometry bridges the gap.
    pub bridged: bool,
}

impl BadData {
    /// What a robot's map leaves out of its log.
    pub fn of(robot: &MappedRobot, stretches: &[BadStretch]) -> Vec<Self> {
        let told = |bad: &BadStretch| BadData {
            fault: bad.fault,
            first_scan: bad.scans.start,
            scans: bad.scans.len(),
            from_secs: robot.stamps[bad.scans.start].clone(),
            to_secs: robot.stamps[bad.scans.end - 1].clone(),
            bridged: bad.bridged,
        };
        stretches.iter().filter(|bad| !bad.scans.is_empty()).map(told).collect()
    }

    /// A line for people.
    pub fn to_text(&self) -> String {
        let what = match self.fault {
            Fault::Lost => "scans contradict the map (carried, fallen, or lost?)",
            Fault::Tipped => "the robot has tipped over",
            Fault::Blind => "the laser sees nothing",
        };
        let then = if self.bridged { "; odometry bridges the gap" } else { "" };
        format!(
            "data went bad at t = {} s: {what}; {} left out, until t = {} s{then}",
            self.from_secs,
            counted(self.scans as u64, "scan"),
            self.to_secs,
        )
    }
}

/// Warns of what is left out, on standard error.
pub fn warn(metrics: &Metrics) {
    for warning in warnings(metrics) {
        eprintln!("warning: {warning}");
    }
}

/// A line for every stretch of bad data, with the robot's name.
pub fn warnings(metrics: &Metrics) -> Vec<String> {
    let of = |log: &crate::metrics::LogMetrics| {
        let name = log.robot.clone();
        log.bad_data.iter().map(move |bad| format!("{name}: {}", bad.to_text())).collect::<Vec<_>>()
    };
    metrics.logs.iter().flat_map(of).collect()
}
