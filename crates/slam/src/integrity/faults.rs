use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Why a robot's data are of no use for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// Scans contradict what the robot saw just before from where it believes to be: it was
    /// carried elsewhere, fell, or lost its way.
    Lost,
    /// The robot leans so far that its laser does not see the plane that is mapped.
    Tipped,
    /// The laser sees nothing but its cover, or nothing at all.
    Blind,
}

/// Scans that were left out of the map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BadStretch {
    /// Why.
    pub fault: Fault,
    /// The scans, by their indices in the order of the robot's observations.
    pub scans: Range<usize>,
    /// The map goes on after the stretch as part of the same island: odometry bridges it.
    pub bridged: bool,
}

/// Noticing bad data. The numbers separate the mishaps of `bench/faults` from all that real logs
/// and the stress logs show while their maps are right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IntegritySettings {
    /// Watch for bad data.
    pub enabled: bool,
    /// A robot that leans farther to any side has tipped over, radians: stairs, the steepest that
    /// robots climb, have up to 45 degrees.
    pub tipped_rad: f64,
    /// Beams shorter than this show the robot's own cover, metres.
    pub cover_m: f64,
    /// A laser of whose beams no more than this share is of use is blind.
    pub blind_share: f64,
    /// Shorter blindness is lived through, seconds.
    pub blind_secs: f64,
    /// So many scans in a row decide that data are bad, or good again.
    pub scans: usize,
    /// A scan of whose points more than this share contradicts the map around does not fit.
    pub contradicting: f64,
    /// The same for a scan that was not found where it was expected.
    pub startled: f64,
    /// The same in standard deviations of what is usual where the robot is: people about contradict
    /// the map all the time.
    pub sigmas: f64,
    /// A piece of map after a cut is left out until the robot has driven so far on it, metres.
    pub proven_m: f64,
}

impl Default for IntegritySettings {
    fn default() -> Self {
        IntegritySettings {
            enabled: true,
            tipped_rad: 0.9,
            cover_m: 0.3,
            blind_share: 0.1,
            blind_secs: 3.0,
            scans: 6,
            contradicting: 0.25,
            startled: 0.08,
            sigmas: 5.0,
            proven_m: 3.0,
        }
    }
}
