//! The map: *patches* (scans with poses) joined by *relations* (relative poses with covariances)
//! into *islands* (connected components).
//!
//! After chapter 5 of the ManifoldSLAM thesis (2006). Patches never move in their own frame; only
//! their poses in the island's frame are re-estimated. A relation knows where it comes from and can
//! be retracted: the manifold is then the one that was built without it.

mod change;
mod islands;
mod key_patches;
mod levels;
mod local_submap;
mod manifold;
mod patch;
mod patch_sighting;
mod path_uncertainty;
mod relation;
mod robot;
mod way;

pub use change::{Change, ManifoldError};
pub use islands::Islands;
pub use key_patches::KeyPatches;
pub use levels::{GroundKind, LevelMember, Levels};
pub use local_submap::{INTERVAL_95, SubmapLimits, SubmapMember};
pub use manifold::Manifold;
pub use patch::{Elevation, Patch, PatchId};
pub use patch_sighting::PatchSighting;
pub use relation::{Provenance, Relation, RelationId, RelationState, Retraction, through_relation};
pub use robot::Robot;
pub use way::{Climb, Way};
