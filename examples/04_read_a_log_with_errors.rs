//! Real logs are damaged. A reader returns what it could read, and says what it left out and why.
//!
//! `cargo run --release -p manifoldslam --example 04_read_a_log_with_errors`

use logs::{CarmenReader, DropReason, ReadOptions};
use sensing::BeamClass;

/// A CARMEN log of five scans as a disk full of bad luck left it. A `FLASER` line holds the number
/// of beams, the ranges, the laser's pose, the robot's pose, and stamps.
const LOG: &str = "\
PARAM robot_frontlaser_offset 0.1
ODOM 0.0 0.0 0.0 0.2 0.0 0.0 10.0 host 0.0
FLASER 5 2.00 2.01 2.02 2.03 2.04 0.1 0.0 0.0 0.0 0.0 0.0 10.100000 host 0.1
FLASER 5 2.00 nan 2.02 81.83 -1.0 0.3 0.0 0.0 0.2 0.0 0.0 10.300000 host 0.3
FLASER 5 2.00 2.01 2.02 0.5 0.0 0.0 0.4 0.0 0.0 10.500000 host 0.5
FLASER 5 2.00 2.01 2.02 2.03 2.04 0.7 inf 0.0 0.6 inf 0.0 10.700000 host 0.7
what is this line doing here
FLASER 5 2.00 2.01 2.02 2.03 2.04 0.9 0.0 0.0 0.8 0.0 0.0 9.900000 host 0.9
FLASER 5 2.00 2.01 2.0";

fn main() {
    // Any `BufRead` will do; `CarmenReader::open` takes files, .gz and .bz2 included.
    let mut reader = CarmenReader::new(LOG.as_bytes(), ReadOptions::default());
    let records: Vec<_> = reader.by_ref().collect();
    for record in &records {
        let classes: Vec<_> =
            (0..record.observation.scan.len()).map(|i| record.observation.scan.class(i)).collect();
        println!("line {}, stamp {}: {classes:?}", record.line, record.stamp_text);
    }

    // Three scans came through; their stamps are kept digit by digit.
    let stamps: Vec<_> = records.iter().map(|record| record.stamp_text.as_str()).collect();
    assert_eq!(stamps, ["10.100000", "10.300000", "9.900000"]);
    // Ranges are classified at the door. Behind it no NaN exists.
    let scan = &records[1].observation.scan;
    assert_eq!(scan.class(1), BeamClass::Invalid);
    assert_eq!(scan.class(3), BeamClass::NoReturn);
    assert_eq!(scan.hit(4), None);
    // The laser's mounting comes from the log.
    assert!((records[0].observation.base_from_laser.x - 0.1).abs() < 1e-9);

    // The other half of the answer: nothing that was lost is silent.
    let report = reader.finish();
    println!("{} of {} lines dropped:", report.dropped_count, report.lines);
    for dropped in &report.dropped {
        println!("  {dropped}");
    }
    let lines: Vec<u64> = report.dropped.iter().map(|dropped| dropped.line).collect();
    assert_eq!(lines, [5, 6, 7, 9]);
    assert_eq!(report.dropped[3].reason, DropReason::Truncated);
    assert_eq!((report.stamps_back, report.invalid_beams), (1, 2));
    // `manifoldslam map` would end with exit code 3: finished, but data was lost.
    assert!(report.is_lossy());
}
