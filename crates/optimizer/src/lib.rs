//! Sparse pose-graph optimisation on Lie groups.
//!
//! A [`PoseGraph`] holds poses (`map_from_node`) and measured relative poses with their
//! information. An [`Optimizer`] finds the most likely poses by damped Gauss-Newton; it keeps the
//! symbolic analysis, so that calling it again on a graph of the same structure is cheap, and
//! answers for covariances ([`Optimizer::marginals`]). Wrong closures are met with robust kernels
//! ([`Kernel`]), graduated non-convexity ([`optimize_gnc`]), consistent sets ([`consistent_set`]),
//! or all at once when most of them may be wrong ([`optimize_robust`]).
//!
//! Everything is generic over the group: SE(2) (`Pose2`, 3) and SE(3) (`Pose3`, 6).
//! The equations are derived in `docs/math/pose-graph.md`.
//!
//! ```
//! use geometry::{Matrix3, Pose2};
//! use manifoldslam_optimizer::{Edge, EdgeKind, PoseGraph, Settings, optimize};
//!
//! // A square walked once; the last edge closes the loop. Odometry turned a little too much.
//! let mut graph = PoseGraph::<Pose2, 3>::new();
//! let step = Pose2::new(1.0, 0.0, 1.6);
//! let mut pose = Pose2::IDENTITY;
//! for id in 0..4 {
//!     graph.add_node(id, pose)?;
//!     pose = pose * step;
//! }
//! for id in 0..3 {
//!     graph.add_edge(Edge::new(id, id + 1, step, Matrix3::identity(), EdgeKind::Sequential))?;
//! }
//! let home = Pose2::new(1.0, 0.0, std::f64::consts::FRAC_PI_2);
//! graph.add_edge(Edge::new(3, 0, home, Matrix3::identity() * 100.0, EdgeKind::Closure))?;
//!
//! let report = optimize(&mut graph, &Settings::default())?;
//! assert!(report.final_cost < 0.1 * report.initial_cost);
//! # Ok::<(), manifoldslam_optimizer::OptimizerError>(())
//! ```

mod admission;
mod cholesky;
mod chordal;
mod clique;
mod components;
mod consistency;
mod error;
mod gate;
mod gnc;
mod graph;
mod initial;
mod joints;
mod kernel;
mod linear_system;
mod marginals;
mod optimizer;
mod robust;
mod settings;
mod spine;
mod structure;
mod support;

pub use chordal::initialize_chordal;
pub use consistency::{
    ClosureCandidate, ConsistencySettings, ConsistentSet, consistent_set, consistent_sets,
};
pub use error::OptimizerError;
pub use gate::chi2_quantile;
pub use gnc::{GncLoss, GncSettings, optimize_gnc};
pub use graph::{Edge, EdgeKind, Node, PoseGraph};
pub use initial::initialize_spanning_tree;
pub use joints::{Joint, find_joints};
pub use kernel::Kernel;
pub use marginals::Marginals;
pub use optimizer::{Optimizer, optimize};
pub use robust::{RobustReport, RobustSettings, optimize_robust};
pub use settings::{Method, Report, RobustScope, Settings, Status};
pub use spine::Spine;
