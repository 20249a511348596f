use super::overlaps::Overlaps;
use super::relocalise::Placed;
use manifold::PatchId;
use std::collections::BTreeMap;

/// What the last global pass measured, for the next to take where it would measure the same.
///
/// It saves work and never shows in the result: every measurement is a function of scans, of the
/// configuration and of relative poses on a grid ([`super::grid::Grid`]), and is taken
/// only where those are the same. What a pass does not need is forgotten with it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// The overlaps of each round.
    pub overlaps: Vec<Overlaps>,
    /// The scans of each group of patches, by the group's first.
    pub placed: BTreeMap<PatchId, Placed>,
}
