//! The pipeline: observations in, events out; a manifold and a pose for every scan at the end.

mod active_submap;
mod config;
mod front_end;
mod loop_closing;
mod mapper;
mod refit;
mod smoother;

pub use config::{ExtensionSettings, OdometrySettings, SlamConfig};
pub use loop_closing::ClosingSettings;
pub use refit::RefitSettings;
pub use mapper::{Mapper, ScanPose};
