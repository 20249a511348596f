use crate::ClosingStatistics;
use serde::{Deserialize, Serialize};
use std::ops::Add;

/// Counts of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Statistics {
    /// Observations taken.
    pub scans: usize,
    /// Scans that became patches.
    pub patches: usize,
    /// Scans whose first match was poor, so that other starting points were tried.
    pub recoveries: usize,
    /// Scans of which the local submap explained less than half in the end.
    pub poor_fits: usize,
    /// Scans not matched because the robot had fallen over.
    pub tipped: usize,
    /// Loop closing.
    pub closures: ClosingStatistics,
    /// Optimisations of all relations.
    pub optimisations: usize,
    /// Overlaps measured by the global refit, over all rounds.
    pub overlaps: usize,
    /// Places compared between islands.
    pub places_compared: usize,
}

impl Add for Statistics {
    type Output = Statistics;

    fn add(self, other: Statistics) -> Statistics {
        Statistics {
            scans: self.scans + other.scans,
            patches: self.patches + other.patches,
            recoveries: self.recoveries + other.recoveries,
            poor_fits: self.poor_fits + other.poor_fits,
            tipped: self.tipped + other.tipped,
            closures: self.closures + other.closures,
            optimisations: self.optimisations + other.optimisations,
            overlaps: self.overlaps + other.overlaps,
            places_compared: self.places_compared + other.places_compared,
        }
    }
}
