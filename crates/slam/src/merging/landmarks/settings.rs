use serde::{Deserialize, Serialize};

/// Closing loops and joining islands by landmarks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LandmarkSettings {
    /// Use landmarks.
    pub enabled: bool,
    /// Share of ids that do not mean the same thing on both islands: read wrong, occurring twice,
    /// moved.
    pub wrong_ids: f64,
    /// Islands are joined by landmarks when the chance that this is wrong is bounded by so much.
    /// Two tags alone mostly fall short (their ids may be exchanged), three do not: see
    /// docs/math/landmarks.md.
    pub false_merges: f64,
    /// Match the scans where a landmark was seen twice: relations are then as accurate as scans,
    /// walls can refute an alignment, and a single landmark may do.
    pub match_scans: bool,
    /// The robots' clocks agree, to a fraction of a second: who saw whom and where that one was
    /// then are put together. To be turned off where they do not.
    pub common_clock: bool,
    /// When poses are re-estimated after a loop is closed by a landmark.
    pub refit: LandmarkRefit,
}

impl Default for LandmarkSettings {
    fn default() -> Self {
        LandmarkSettings {
            enabled: true,
            wrong_ids: 0.1,
            false_merges: 0.01,
            match_scans: true,
            common_clock: true,
            refit: LandmarkRefit::Continuous,
        }
    }
}

/// When poses are re-estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LandmarkRefit {
    /// At once.
    #[default]
    Continuous,
    /// In the global pass alone: during the run relations are added and nothing moves, as the
    /// thesis decomposes algorithms 5.3 and 5.5.
    AtEnd,
}
