use crate::PatchId;
use sensing::{Sighting, Stamp};

/// A landmark seen from a patch, or so near to it that the robot knew where it was from there.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchSighting {
    /// The patch.
    pub patch: PatchId,
    /// When it was seen: where the landmark moves, that matters.
    pub stamp: Stamp,
    /// What was seen, in the frame of the patch.
    pub sighting: Sighting,
}
