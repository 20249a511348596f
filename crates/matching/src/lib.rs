//! Scan matchers behind one trait: where was a scan taken, seen from a reference?
//!
//! A [`Matcher`] compares a *scan cloud* (points in the new scan's `base` frame) with a *reference
//! cloud* (points in the reference frame: one earlier scan, or a local submap of any size and field
//! of view) and answers with a [`MatchResult`]: pose, covariance, inlier ratio, status. A weak
//! match is a value, never an error.
//!
//! ```
//! use geometry::Pose2;
//! use manifoldslam_matching::{PointCloud, PointCloudSettings, Prior, matcher};
//! use synthetic::{LaserNoise, Scanner, noisy_room_pair};
//!
//! let scanner = Scanner::half_circle(361, LaserNoise::gaussian(0.01));
//! let pair = noisy_room_pair(1, &scanner, 0.2, 0.1);
//! let settings = PointCloudSettings::default();
//! let [reference, scan] = [&pair.reference, &pair.scan]
//!     .map(|scan| PointCloud::from_scan(scan, &Pose2::IDENTITY, &settings));
//! let found = matcher("wsm").unwrap().align(&reference, &scan, &Prior::guess(Pose2::IDENTITY));
//! assert!(found.status.is_usable());
//! assert!(found.pose.distance(&pair.truth()) < 0.01);
//! ```

mod bound;
mod branch_and_bound;
mod closest;
mod cloud;
mod combined;
mod compact_points;
mod correlative;
mod disk;
mod fast;
mod field_matcher;
mod gicp;
mod icp;
mod idc;
mod likelihood;
mod line_fit;
mod line_points;
mod matcher;
mod mbicp;
mod ndt;
mod neighbours;
mod normal_equations;
mod plicp;
mod point_blocks;
mod polyline;
mod projection;
pub mod protocol;
mod registry;
mod search;
mod surfel;
mod surfel_field;
mod vgicp;
mod wide;
mod wsm;

pub use bound::{cramer_rao_bound, fisher_information};
pub use branch_and_bound::BranchAndBoundMatcher;
pub use closest::ClosestSettings;
pub use cloud::{CloudPoint, PointCloud, PointCloudSettings};
pub use combined::{CombinedMatcher, CombinedReference, CombinedSettings};
pub use compact_points::CompactPoints;
pub use correlative::CorrelativeMatcher;
pub use fast::{FastMatcher, FastSettings};
pub use field_matcher::FieldMatcher;
pub use gicp::{GicpMatcher, GicpSettings};
pub use icp::IcpMatcher;
pub use idc::{IdcMatcher, IdcSettings};
pub use likelihood::{LikelihoodPyramid, LikelihoodSettings};
pub use line_fit::{LineFit, LineFitSettings, fit_lines};
pub use line_points::{BeamNoise, LineExtractor, LinePoint};
pub use matcher::{MatchResult, MatchStatus, Matcher, Prior};
pub use mbicp::{MbIcpMatcher, MbIcpSettings};
pub use ndt::{NdtD2dMatcher, NdtD2dSettings, NdtMatcher, NdtSettings};
pub use neighbours::NeighbourTree;
pub use plicp::PlIcpMatcher;
pub use registry::{MATCHER_NAMES, MatcherKind, matcher};
pub use search::{Candidate, SearchOutcome, SearchSettings, SearchWindow};
pub use surfel_field::{FieldSettings, SurfelField};
pub use vgicp::{VgicpMatcher, VgicpSettings};
pub use wide::WideSettings;
pub use wsm::{WsmCovariance, WsmMatcher, WsmSettings};
