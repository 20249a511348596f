//! How a robot leans, in a CARMEN log: a message of our own.

use crate::DropReason;
use crate::carmen_line::{Fault, Fields};
use sensing::{Attitude, Stamp};
use std::f64::consts::PI;

/// A reading tells nothing of a scan that was taken longer before or after it, seconds: at walking
/// pace a robot is then half a metre on, and its ground may be another.
const LONGEST_SECS: f64 = 0.5;

/// What an inertial unit read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AttitudeLine {
    pub attitude: Attitude,
    pub stamp: Stamp,
}

impl AttitudeLine {
    /// The attitude, where it still holds for a scan.
    pub fn at(&self, scan: Stamp) -> Option<Attitude> {
        let secs = scan.secs_since(self.stamp);
        (secs.abs() <= LONGEST_SECS).then_some(self.attitude)
    }
}

/// `ATTITUDE roll pitch stamp host logger_stamp`, radians (docs/levels.md).
pub(crate) fn attitude(mut fields: Fields, complete: bool) -> Result<AttitudeLine, Fault> {
    if fields.clone().total() > 5 {
        return Err(Fault { field: None, reason: DropReason::ExtraField });
    }
    let [roll_rad, pitch_rad] = [angle(&mut fields)?, angle(&mut fields)?];
    let (stamp, _) = fields.stamp(complete)?;
    Ok(AttitudeLine { attitude: Attitude { roll_rad, pitch_rad }, stamp })
}

/// An angle of at most half a turn; more is most likely in degrees.
fn angle(fields: &mut Fields) -> Result<f64, Fault> {
    let angle = fields.number()?;
    if angle.abs() <= PI { Ok(angle) } else { Err(fields.fault(DropReason::NotAnAngle)) }
}
