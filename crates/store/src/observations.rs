//! The scans of a robot's log as they were taken, many in a block.

use crate::cells::{CellReader, Cells};
use crate::rows::{attitude, attitude_numbers, coordinates, pose, sweep, sweep_numbers};
use crate::scan_codec;
use flate2::Compression;
use flate2::read::{DeflateDecoder, DeflateEncoder};
use geometry::Pose2;
use sensing::{Attitude, RobotId, Scan, Sweep};
use std::io::Read;
use std::sync::Arc;

/// Scans of a block, at most.
const MOST_SCANS: usize = 4096;
/// A block unpacks to this many bytes at most.
const MOST_BYTES: u64 = 1 << 30;

/// A scan as it was taken: with its place in the trajectory, all that a global pass needs.
#[derive(Clone, Debug, PartialEq)]
pub struct TakenScan {
    /// The robot's base in the frame of the scan's patch, as it was found at once.
    pub found: Pose2,
    /// Mounting of the laser on the robot.
    pub base_from_laser: Pose2,
    /// How the robot moved while the scan was taken.
    pub sweep: Option<Sweep>,
    /// How the base leaned.
    pub attitude: Option<Attitude>,
    /// The scan; `None` when it is that of its patch, which has it.
    pub scan: Option<Arc<Scan>>,
}

/// Consecutive scans of one robot, packed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObservationBlock {
    /// The robot.
    pub robot: RobotId,
    /// Place of the first in the robot's log.
    pub first_scan: usize,
    /// How many they are.
    pub scans: usize,
    pub(crate) data: Arc<[u8]>,
}

impl ObservationBlock {
    /// Packs consecutive scans; `None` when one of them could not be had back bit by bit.
    pub fn pack(robot: RobotId, first_scan: usize, scans: &[TakenScan]) -> Option<Self> {
        let mut plain = Vec::new();
        for taken in scans {
            plain.extend(cells(taken)?.to_bytes());
        }
        let mut data = Vec::new();
        // Hardly larger than at the highest level, and many times faster.
        DeflateEncoder::new(&plain[..], Compression::fast()).read_to_end(&mut data).ok()?;
        (scans.len() <= MOST_SCANS).then(|| ObservationBlock {
            robot,
            first_scan,
            scans: scans.len(),
            data: data.into(),
        })
    }

    /// The scans again; `None` when the block does not hold them.
    pub fn unpack(&self) -> Option<Vec<TakenScan>> {
        let mut plain = Vec::new();
        DeflateDecoder::new(&self.data[..]).take(MOST_BYTES).read_to_end(&mut plain).ok()?;
        let mut row = Cells::from_bytes(&plain)?.reader();
        let scans: Option<Vec<_>> = (0..self.scans).map(|_| read(&mut row)).collect();
        row.end().and(scans)
    }
}

fn cells(taken: &TakenScan) -> Option<Cells> {
    let scan = match &taken.scan {
        Some(scan) => scan_codec::encode_exactly(scan)?,
        None => Vec::new(),
    };
    let cells = Cells::default()
        .reals(coordinates(&taken.found))
        .reals(coordinates(&taken.base_from_laser))
        .maybe_reals(taken.sweep.map(sweep_numbers))
        .maybe_reals(taken.attitude.map(attitude_numbers))
        .blob(scan);
    cells.is_finite().then_some(cells)
}

fn read(row: &mut CellReader) -> Option<TakenScan> {
    let (found, base_from_laser) = (pose(row.reals()?), pose(row.reals()?));
    let sweep = row.maybe_reals()?.map(sweep);
    let attitude = row.maybe_reals()?.map(attitude);
    let scan = match &row.blob()?[..] {
        [] => None,
        bytes => Some(Arc::new(scan_codec::decode(bytes)?)),
    };
    Some(TakenScan { found, base_from_laser, sweep, attitude, scan })
}

#[cfg(test)]
mod tests {
    // A test that cannot unwrap has failed.
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;
    use sensing::{LaserModel, Twist};

    fn taken(readings: &[f32], full: bool) -> TakenScan {
        let sweep = Sweep {
            twist: Twist { forward_m_per_sec: 0.3, yaw_rad_per_sec: -0.0 },
            duration_secs: 0.1,
            reference: 0.5,
        };
        TakenScan {
            found: Pose2 { x: f64::from(readings[0]), y: -0.0, yaw: 1.0 / 3.0 },
            base_from_laser: Pose2 { x: 0.1, y: 0.0, yaw: 0.0 },
            sweep: full.then_some(sweep),
            attitude: full.then_some(Attitude { roll_rad: 0.1, pitch_rad: -0.2 }),
            scan: full.then(|| Arc::new(Scan::classify(LaserModel::half_circle(5), readings))),
        }
    }

    proptest! {
        #[test]
        fn scans_come_back(
            readings in prop::collection::vec(prop::collection::vec(0.0..60.0f32, 5), 0..20),
            damage: Option<(usize, u8)>,
        ) {
            let scans: Vec<_> =
                readings.iter().enumerate().map(|(i, r)| taken(r, i % 3 > 0)).collect();
            let mut block = ObservationBlock::pack(RobotId(3), 17, &scans).unwrap();
            prop_assert_eq!(block.unpack(), Some(scans));
            if let Some((at, bits)) = damage {
                let mut bytes = block.data.to_vec();
                let at = at % bytes.len();
                bytes[at] ^= bits;
                block.data = bytes.into();
                let _ = block.unpack();
            }
        }
    }

    #[test]
    fn what_is_no_number_is_refused() {
        let scan =
            TakenScan { found: Pose2 { x: f64::NAN, y: 0.0, yaw: 0.0 }, ..taken(&[1.0; 5], true) };
        assert_eq!(ObservationBlock::pack(RobotId(0), 0, &[scan]), None);
    }
}
