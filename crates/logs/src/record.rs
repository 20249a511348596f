use sensing::{Observation, Twist};

/// One scan of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct LogRecord {
    /// Number of the line in the log, from 1.
    pub line: u64,
    /// The stamp as the log has it, digit by digit: trajectories are written with it.
    pub stamp_text: String,
    /// The scan with its odometry and mounting.
    pub observation: Observation,
    /// The base's velocity when the scan was taken, where the log tells.
    pub twist: Option<Twist>,
}
