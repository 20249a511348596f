//! Scan matchers behind one trait: where was a scan taken, seen from a reference?
//!
//! A [`Matcher`] compares a *scan cloud* (points in the new scan's `base` frame) with a *reference
//! cloud* (points in the reference frame: one earlier scan, or a local submap of any size and field
//! of view) and answers with a [`MatchResult`]: pose, covariance, inlier ratio, status. A weak match is
//! a value, never an error.

mod cloud;
mod fast;
mod likelihood;
mod line_fit;
mod matcher;
mod projection;
mod search;
mod surfel_field;

pub use cloud::{CloudPoint, PointCloud, PointCloudSettings};
pub use fast::{FastMatcher, FastSettings};
pub use line_fit::{LineFit, LineFitSettings, fit_lines};
pub use likelihood::{LikelihoodPyramid, LikelihoodSettings};
pub use matcher::{MatchResult, MatchStatus, Matcher, Prior};
pub use search::{Candidate, SearchOutcome, SearchSettings, SearchWindow};
pub use surfel_field::{BeamNoise, FieldSettings, LinePoint, SurfelField, line_points};
