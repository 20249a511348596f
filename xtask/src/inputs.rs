//! Input for the end-to-end checks: a small log of a square room, and what can go wrong with it.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

/// Half the side of the room, metres.
const HALF: f64 = 3.0;
/// Beams of a scan.
const BEAMS: usize = 180;

/// A CARMEN log: `scans` scans while driving 1 m through the room.
pub fn log(scans: usize) -> String {
    (0..scans).map(|k| line(k, BEAMS, 100.0 + 0.2 * k as f64, |_, r| format!("{r:.2}"))).collect()
}

/// One FLASER line; `reading` writes a range.
pub fn line(k: usize, beams: usize, stamp: f64, reading: impl Fn(usize, f64) -> String) -> String {
    let (x, y, yaw) = (0.02 * k as f64, 0.1, 0.05);
    let mut line = format!("FLASER {beams}");
    for i in 0..beams {
        let (s, c) = (yaw - FRAC_PI_2 + PI * i as f64 / beams as f64).sin_cos();
        let along = |p: f64, d: f64| (HALF.copysign(d) - p) / d;
        let range = along(x, c).min(along(y, s));
        let _ = write!(line, " {}", reading(i, range));
    }
    let _ = writeln!(line, " {x} {y} {yaw} {x} {y} {yaw} {stamp:.6} host {stamp:.6}");
    line
}

/// Logs with damage that a reader survives: names and contents.
pub fn damaged() -> Vec<(&'static str, Vec<u8>)> {
    let good = log(40);
    let odd = |what: &'static str| {
        move |i: usize, r: f64| {
            if i % 7 == 3 { what.to_owned() } else { format!("{r:.2}") }
        }
    };
    let with = |extra: String| format!("{good}{extra}{}", log(20)).into_bytes();
    vec![
        ("nan.clf", with(line(40, BEAMS, 108.0, odd("nan")))),
        ("inf.clf", with(line(40, BEAMS, 108.0, odd("inf")))),
        ("negative.clf", with(line(40, BEAMS, 108.0, odd("-1.5")))),
        ("words.clf", with(line(40, BEAMS, 108.0, odd("wall")))),
        ("no-beams.clf", with(line(40, 0, 108.0, odd("")))),
        ("beam-count.clf", with(line(40, 361, 108.0, odd("2.0")))),
        ("huge-count.clf", with("FLASER 4000000000 1 2 3\n".to_owned())),
        ("stamps-back.clf", with(line(40, BEAMS, 3.0, odd("2.0")))),
        ("cut.clf", good.as_bytes()[..good.len() - 400].to_vec()),
        ("noise.clf", [good.as_bytes(), &[0, 255, 254, 10, 13, 0], good.as_bytes()].concat()),
    ]
}

/// Files that are no log at all.
pub fn hopeless() -> Vec<(&'static str, Vec<u8>)> {
    let noise: Vec<u8> =
        (0..20_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    vec![
        ("empty.clf", Vec::new()),
        ("binary.clf", noise.clone()),
        ("not-really.clf.gz", [&[0x1f, 0x8b, 8, 0][..], &noise].concat()),
        ("not-really.clf.bz2", [&b"BZh9"[..], &noise].concat()),
        ("long-line.clf", vec![b'7'; 30_000_000]),
    ]
}
