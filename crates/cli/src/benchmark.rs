//! The comparison of scan matchers: the ManifoldSLAM thesis's protocol (2006, section 7.1) and
//! what it leaves out: accuracy against the Cramer-Rao bound, honesty, degenerate places, basins.
//!
//! Reading order: [`args`], [`contender`], [`situations`], [`accuracy`], [`rooms`], [`degenerate`],
//! [`basins`], then the user's own scans and logs, then tables and pictures.

pub mod accuracy;
pub mod args;
pub mod basins;
pub mod contender;
pub mod csv;
pub mod degenerate;
pub mod own_scans;
pub mod pictures;
pub mod real_log;
pub mod rooms;
pub mod situations;
pub mod table;
pub mod tables;
pub mod thesis;
pub mod visible;

use degenerate::DegenerateResult;
use real_log::LogResult;
use rooms::AccuracyResult;
use serde::Serialize;
use situations::SituationResult;

/// Everything that one run of the comparison found.
#[derive(Debug, Default, Serialize)]
pub struct Comparison {
    /// What noise the situations' scans had, in words.
    pub noise: String,
    /// Seed of all noise.
    pub seed: u64,
    /// Repeats with fresh noise.
    pub repeats: usize,
    /// The situations, with the thesis's protocol.
    pub situations: Vec<SituationResult>,
    /// Accuracy in rooms and against submaps.
    pub accuracy: Vec<AccuracyResult>,
    /// Places where one direction is not observed.
    pub degenerate: Vec<DegenerateResult>,
    /// Agreement on a real log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log: Option<LogResult>,
}
