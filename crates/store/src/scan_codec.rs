//! Scans in few bytes, every bit of every range kept.
//!
//! Laser logs tell ranges in whole centimetres or millimetres. Where all of a scan's ranges are
//! such, whole numbers are stored, each as the difference to the one before; else the bits of
//! adjacent floats are compared and sorted by byte. Both are then deflated.

use crate::cells::{read_signed, read_varint, take, write_signed, write_varint};
use flate2::Compression;
use flate2::read::{DeflateDecoder, DeflateEncoder};
use sensing::{BeamClass, LaserModel, Scan};
use std::io::Read;

/// Scans with more beams are refused: a scanner that turns in steps of 0.02 degrees has 18,000.
pub(crate) const MAX_BEAMS: usize = 65_536;
/// Bytes that a beam and the laser's model take at most, before they are deflated.
const MAX_BEAM_BYTES: usize = 12;
const MODEL_BYTES: usize = 64;
/// Steps tried for ranges, as powers of ten of a metre: from decimetres to tenths of a millimetre.
const DECIMALS: std::ops::RangeInclusive<u8> = 1..=4;
/// Marks ranges stored as bits.
const AS_BITS: u8 = 0;
const CLASSES: [BeamClass; 4] =
    [BeamClass::Hit, BeamClass::NoReturn, BeamClass::TooClose, BeamClass::Invalid];

/// `None` when the scan could not be had back bit by bit: too many beams, or ranges that its own
/// limits do not allow.
pub(crate) fn pack(scan: &Scan) -> Option<Vec<u8>> {
    let plain = encode_exactly(scan)?;
    let mut packed = Vec::new();
    DeflateEncoder::new(&plain[..], Compression::best()).read_to_end(&mut packed).ok()?;
    Some(packed)
}

/// The bytes before they are deflated; `None` when the scan could not be had back bit by bit.
pub(crate) fn encode_exactly(scan: &Scan) -> Option<Vec<u8>> {
    if scan.len() > MAX_BEAMS {
        return None;
    }
    let plain = encode(scan);
    same_bits(scan, &decode(&plain)?).then_some(plain)
}

/// `None` when the bytes are not a packed scan.
pub(crate) fn unpack(packed: &[u8]) -> Option<Scan> {
    let limit = MODEL_BYTES + MAX_BEAMS * MAX_BEAM_BYTES;
    let mut plain = Vec::new();
    DeflateDecoder::new(packed).take(limit as u64).read_to_end(&mut plain).ok()?;
    decode(&plain)
}

fn encode(scan: &Scan) -> Vec<u8> {
    let laser = scan.laser();
    let mut bytes = Vec::with_capacity(MODEL_BYTES + 3 * scan.len());
    write_varint(&mut bytes, scan.len() as u64);
    bytes.extend(laser.angle_min_rad.to_le_bytes());
    bytes.extend(laser.angle_increment_rad.to_le_bytes());
    bytes.extend(laser.range_min_m.to_le_bytes());
    bytes.extend(laser.range_max_m.to_le_bytes());
    write_classes(&mut bytes, scan);
    let hits: Vec<f32> = (0..scan.len()).filter_map(|i| scan.hit(i)).collect();
    let whole = DECIMALS.into_iter().find_map(|decimals| Some((decimals, steps(&hits, decimals)?)));
    match whole {
        Some((decimals, steps)) => {
            bytes.push(decimals);
            let mut before = 0;
            for step in steps {
                write_signed(&mut bytes, step.wrapping_sub(before));
                before = step;
            }
        }
        None => {
            bytes.push(AS_BITS);
            let mut before = 0;
            let changes = hits.iter().map(|hit| {
                let bits = hit.to_bits();
                std::mem::replace(&mut before, bits) ^ bits
            });
            let changes: Vec<[u8; 4]> = changes.map(u32::to_be_bytes).collect();
            (0..4).for_each(|byte| bytes.extend(changes.iter().map(|change| change[byte])));
        }
    }
    bytes
}

/// `None` when the bytes are not those of a scan.
pub(crate) fn decode(mut plain: &[u8]) -> Option<Scan> {
    let bytes = &mut plain;
    let beams = usize::try_from(read_varint(bytes)?).ok().filter(|n| *n <= MAX_BEAMS)?;
    let laser = LaserModel {
        beams: beams as u32,
        angle_min_rad: f64::from_le_bytes(take(bytes, 8)?.try_into().ok()?),
        angle_increment_rad: f64::from_le_bytes(take(bytes, 8)?.try_into().ok()?),
        range_min_m: f32::from_le_bytes(take(bytes, 4)?.try_into().ok()?),
        range_max_m: f32::from_le_bytes(take(bytes, 4)?.try_into().ok()?),
    };
    let classes = read_classes(bytes, beams)?;
    let hits = classes.iter().filter(|c| **c == BeamClass::Hit).count();
    let mut ranges = match take(bytes, 1)?[0] {
        AS_BITS => read_bits(bytes, hits)?,
        decimals if DECIMALS.contains(&decimals) => read_steps(bytes, hits, decimals)?,
        _ => return None,
    }
    .into_iter();
    if !bytes.is_empty() {
        return None;
    }
    // Readings that are classified as their beams once were.
    let readings: Option<Vec<f32>> = classes
        .iter()
        .map(|class| match class {
            BeamClass::Hit => ranges.next(),
            BeamClass::NoReturn => Some(f32::INFINITY),
            BeamClass::TooClose => Some(f32::NEG_INFINITY),
            BeamClass::Invalid => Some(f32::NAN),
        })
        .collect();
    let scan = Scan::classify(laser, &readings?);
    classes.iter().enumerate().all(|(i, class)| scan.class(i) == *class).then_some(scan)
}

/// Ranges as whole numbers of steps of `10^-decimals` metres; `None` when one is not.
fn steps(hits: &[f32], decimals: u8) -> Option<Vec<i64>> {
    let per_metre = f64::from(10u32.pow(decimals.into()));
    hits.iter()
        .map(|&hit| {
            // Saturates where the number is too large, which is then not exact.
            let step = (f64::from(hit) * per_metre).round() as i64;
            let back = (step as f64 / per_metre) as f32;
            (back.to_bits() == hit.to_bits()).then_some(step)
        })
        .collect()
}

fn read_steps(bytes: &mut &[u8], hits: usize, decimals: u8) -> Option<Vec<f32>> {
    let per_metre = f64::from(10u32.pow(decimals.into()));
    let mut step = 0i64;
    (0..hits)
        .map(|_| {
            step = step.wrapping_add(read_signed(bytes)?);
            Some((step as f64 / per_metre) as f32)
        })
        .collect()
}

fn read_bits(bytes: &mut &[u8], hits: usize) -> Option<Vec<f32>> {
    let planes = take(bytes, 4 * hits as u64)?;
    let mut bits = 0;
    let hit = |i| {
        let change = [0, 1, 2, 3].map(|byte| planes[byte * hits + i]);
        bits ^= u32::from_be_bytes(change);
        f32::from_bits(bits)
    };
    Some((0..hits).map(hit).collect())
}

/// Runs of beams of one class: class and length.
fn write_classes(bytes: &mut Vec<u8>, scan: &Scan) {
    let mut beam = 0;
    while beam < scan.len() {
        let class = scan.class(beam);
        let length = (beam..scan.len()).take_while(|i| scan.class(*i) == class).count();
        let index = CLASSES.iter().position(|known| *known == class).unwrap_or_default();
        write_varint(bytes, (length * CLASSES.len() + index) as u64);
        beam += length;
    }
}

fn read_classes(bytes: &mut &[u8], beams: usize) -> Option<Vec<BeamClass>> {
    let mut classes = Vec::with_capacity(beams);
    while classes.len() < beams {
        let run = usize::try_from(read_varint(bytes)?).ok()?;
        let length = run / CLASSES.len();
        if length == 0 || length > beams - classes.len() {
            return None;
        }
        classes.extend(std::iter::repeat_n(CLASSES[run % CLASSES.len()], length));
    }
    Some(classes)
}

/// Equal, bit by bit.
pub(crate) fn same_bits(a: &Scan, b: &Scan) -> bool {
    let model = |scan: &Scan| {
        let laser = scan.laser();
        let angles = [laser.angle_min_rad.to_bits(), laser.angle_increment_rad.to_bits()];
        (laser.beams, angles, laser.range_min_m.to_bits(), laser.range_max_m.to_bits())
    };
    a.len() == b.len()
        && model(a) == model(b)
        && (0..a.len())
            .all(|i| a.class(i) == b.class(i) && a.range(i).to_bits() == b.range(i).to_bits())
}

#[cfg(test)]
mod tests {
    // A test that cannot unwrap has failed.
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    fn reading() -> impl Strategy<Value = f32> {
        let centimetres = (0..9000i32).prop_map(|step| step as f32 / 100.0);
        let special =
            vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, -0.0, 1e-40, 39.9];
        prop_oneof![4 => centimetres, 2 => -1.0..90.0f32, 1 => prop::sample::select(special)]
    }

    proptest! {
        #[test]
        fn every_bit_comes_back(
            readings in prop::collection::vec(reading(), 0..200),
            range_min_m in prop::sample::select(vec![0.0f32, 0.05, 2.5]),
            step in 1..4usize,
        ) {
            let laser = LaserModel { range_min_m, ..LaserModel::half_circle(181) };
            let scan = Scan::classify(laser, &readings).every(step);
            let back = unpack(&pack(&scan).unwrap()).unwrap();
            prop_assert!(same_bits(&scan, &back));
        }

        #[test]
        fn any_bytes_are_taken_or_refused(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            at: usize,
            bit in 0..8u32,
        ) {
            let _ = (unpack(&bytes), decode(&bytes));
            let scan = Scan::classify(LaserModel::half_circle(4), &[1.0, 2.0, 3.3333, 99.0]);
            let mut plain = encode(&scan);
            let at = at % plain.len();
            plain[at] ^= 1 << bit;
            let _ = decode(&plain);
        }
    }

    #[test]
    fn centimetres_take_a_byte_or_so_a_beam() {
        let readings: Vec<f32> =
            (0..180).map(|i| ((300.0 + 100.0 * (i as f32 * 0.2).sin()).round()) / 100.0).collect();
        let scan = Scan::classify(LaserModel::half_circle(180), &readings);
        assert!(pack(&scan).unwrap().len() < 280, "{}", pack(&scan).unwrap().len());
    }

    #[test]
    fn what_cannot_come_back_is_refused() {
        // With a limit that is no number an infinite reading counts as a hit; it comes back.
        let laser = LaserModel { range_max_m: f32::NAN, ..LaserModel::half_circle(2) };
        let scan = Scan::classify(laser, &[1.0, f32::INFINITY]);
        assert!(same_bits(&scan, &unpack(&pack(&scan).unwrap()).unwrap()));
        let laser = LaserModel { range_min_m: 0.0, ..LaserModel::half_circle(1) };
        let scan = Scan::classify(laser, &[-0.0]);
        assert!(same_bits(&scan, &unpack(&pack(&scan).unwrap()).unwrap()), "a step of -0");
        let beams = vec![1.0; MAX_BEAMS + 1];
        assert!(pack(&Scan::classify(LaserModel::half_circle(1), &beams)).is_none());
    }
}
