//! The pipeline: observations in, events out; a manifold and a pose for every scan at the end.
//!
//! [`Mapper::step`] localises each scan in the local submap of the nearest patches, extends the
//! manifold when the fit says so, and looks for loops at new patches; [`Mapper::finish`] refits
//! the whole map and places every scan in it. Nothing here does IO or reads a clock.

mod active_submap;
mod climbing;
mod config;
mod elevation;
mod event;
mod front_end;
mod integrity;
mod localiser;
mod loop_closing;
mod map;
mod mapper;
mod merging;
mod motion_model;
mod odometer;
mod patch_grid;
mod plausibility;
mod preparation;
mod recovery;
mod refit;
mod sightings;
mod statistics;
mod team;
mod track;
mod unit_bias;

pub use climbing::Leveller;
pub use config::{ExtensionSettings, RelationFloor, SlamConfig};
pub use elevation::{ElevationSettings, KnownGround};
pub use event::{Event, Stage, StageObserver, Unobserved};
pub use integrity::{BadStretch, Fault, IntegritySettings};
pub use loop_closing::{ClosingSettings, ClosingStatistics, Rejection};
pub use mapper::Mapper;
pub use merging::{
    EvidenceCounts, IslandLandmark, IslandLandmarks, LandmarkAlignment, LandmarkRefit,
    LandmarkSettings, Merge, MergeState, MergingSettings, compare_landmarks,
};
pub use motion_model::OdometrySettings;
pub use preparation::{Preparation, PreparedObservation};
pub use refit::{RefitMethod, RefitSettings};
pub use statistics::Statistics;
pub use team::{StoredScan, StoredTeam, Team};
pub use track::ScanPose;
