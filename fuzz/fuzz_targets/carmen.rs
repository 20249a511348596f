//! Any bytes as a log, plain and as an archive.
#![no_main]

use libfuzzer_sys::fuzz_target;
use logs::{CarmenReader, ReadOptions, ReadReport, decompress};
use std::io::{BufRead, Cursor, Read};

/// Most text unpacked from one input: archives of megabytes would only slow the fuzzer down.
const MAX_UNPACKED: u64 = 1 << 20;

fuzz_target!(|data: &[u8]| {
    let report = check(data);
    let lines = data.split_inclusive(|&b| b == b'\n').count();
    assert_eq!(report.lines, lines as u64);
    if let Ok(unpacked) = decompress(Cursor::new(data.to_vec())) {
        check(std::io::BufReader::new(unpacked.take(MAX_UNPACKED)));
    }
});

fn check(input: impl BufRead) -> ReadReport {
    // A small limit, so that the fuzzer reaches it.
    let options = ReadOptions { line_limit: 4096, ..ReadOptions::default() };
    let mut reader = CarmenReader::new(input, options);
    let mut scans = 0;
    let mut last_line = 0;
    let mut sightings = 0;
    for record in reader.by_ref() {
        scans += 1;
        assert!(record.line > last_line, "records in the order of the lines");
        last_line = record.line;
        assert!(record.stamp_text.parse::<f64>().is_ok_and(f64::is_finite));
        let seen = &record.observation;
        let scan = &seen.scan;
        assert!(!scan.is_empty() && scan.len() < 4096);
        assert_eq!(scan.laser().beams as usize, scan.len());
        assert!(scan.laser().bearing(scan.len() - 1).is_finite());
        let max = scan.laser().range_max_m;
        assert!((0..scan.len()).all(|i| scan.range(i) >= 0.0 && scan.range(i) <= max));
        sightings += seen.sightings.len() as u64;
        for sighting in &seen.sightings {
            let covariance = &sighting.covariance;
            assert!(sighting.position.iter().chain(covariance.iter()).all(|v| v.is_finite()));
            assert!(covariance[(0, 0)] > 0.0 && covariance[(1, 1)] > 0.0);
        }
        let mounting = seen.base_from_laser;
        assert!(mounting.norm() < 1000.0 && mounting.yaw.is_finite());
    }
    let report = reader.finish();
    assert_eq!((report.scans, report.sightings), (scans, sightings));
    assert!(report.dropped.len() <= 100 && report.dropped.len() as u64 <= report.dropped_count);
    report
}
