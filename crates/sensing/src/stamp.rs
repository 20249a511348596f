use serde::{Deserialize, Serialize};

/// A point in time: nanoseconds since an epoch of the log's own.
///
/// Stamps name scans; they do not order them (real logs jump back).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Stamp(pub i64);

impl Stamp {
    /// The stamp in seconds; exact to about 0.2 microseconds for dates of this century.
    pub fn as_secs(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// A stamp from seconds; saturates at the range of `i64` nanoseconds, NaN becomes 0.
    pub fn from_secs(secs: f64) -> Self {
        Stamp((secs * 1e9).round() as i64)
    }

    /// `self - earlier` in seconds, negative when the log jumps back.
    pub fn secs_since(self, earlier: Stamp) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }
}
