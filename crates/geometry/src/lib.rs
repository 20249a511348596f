//! Poses in the plane and in space, angles and Gaussian poses.
//!
//! Conventions, said once here and used by every crate:
//! - right-handed frames, x forward, y left, z up, yaw counter-clockwise; metres and radians;
//! - a transform is named `target_from_source` and maps coordinates in `source` to `target`;
//! - tangent vectors are translation first, `(x, y, yaw)`; perturbations act on the right,
//!   `pose * Pose2::exp(delta)`, that is, in the body's own frame.
//!
//! ```
//! use manifoldslam_geometry::Pose2;
//! let map_from_robot = Pose2::new(1.0, 2.0, std::f64::consts::FRAC_PI_2);
//! let robot_from_wall = Pose2::new(3.0, 0.0, 0.0);
//! let map_from_wall = map_from_robot * robot_from_wall;
//! assert!((map_from_wall.y - 5.0).abs() < 1e-12);
//! ```

mod angle;
mod gaussian;
mod lie;
mod pose2;
mod pose3;

pub use angle::wrap_angle;
pub use gaussian::{Gaussian, GaussianPose2};
pub use lie::LieGroup;
pub use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
pub use pose2::Pose2;
pub use pose3::Pose3;
