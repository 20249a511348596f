use crate::ScanPose;
use manifold::Change;
use serde::Serialize;

/// What a step of the pipeline brought forth.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A scan was localised: its index in the order of observations, and where it was taken.
    Localised(usize, ScanPose),
    /// The map changed.
    Map(Change),
}

/// The parts of the pipeline that are timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Scans to line points.
    Lines,
    /// Matching with the local submap, extending the manifold.
    Localisation,
    /// Searching and verifying loop closures.
    LoopClosing,
    /// Optimising relations after closures.
    Optimisation,
    /// Joining islands.
    Merging,
    /// The global refit.
    Refit,
    /// Placing every scan in the refitted map.
    Relocalisation,
}

/// Told when a stage begins and ends; the pipeline itself reads no clock.
pub trait StageObserver: Send + Sync {
    /// A stage begins.
    fn begin(&mut self, stage: Stage);
    /// The stage that began last ends.
    fn end(&mut self, stage: Stage);
}

/// An observer that does nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unobserved;

impl StageObserver for Unobserved {
    fn begin(&mut self, _: Stage) {}
    fn end(&mut self, _: Stage) {}
}
