//! What the sensors say, made safe at the door: scans with classified beams, odometry, stamps.
//!
//! Ranges are classified here into [`BeamClass`]; beyond this crate no range is NaN.
//!
//! ```
//! use manifoldslam_sensing::{BeamClass, LaserModel, Scan};
//! let laser = LaserModel::half_circle(3);
//! let scan = Scan::classify(laser, &[1.0, f32::NAN, 90.0]);
//! assert_eq!(scan.class(0), BeamClass::Hit);
//! assert_eq!(scan.class(1), BeamClass::Invalid);
//! assert_eq!(scan.class(2), BeamClass::NoReturn);
//! ```

mod attitude;
mod decimation;
mod deskew;
mod levelling;
mod limits;
mod observation;
mod scan;
mod sighting;
mod stamp;

pub use attitude::Attitude;
pub use deskew::{DeskewSettings, DeskewedHit, Sweep, Twist, Velocimeter};
pub use levelling::Levelling;
pub use limits::{LaserLimits, NoReturnDetector};
pub use observation::{Observation, RobotId};
pub use scan::{BeamClass, LaserModel, Scan};
pub use sighting::{LandmarkKind, Sighting};
pub use stamp::Stamp;
