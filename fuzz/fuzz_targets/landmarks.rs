//! Any bytes as a table of landmarks beside a log of three scans.
#![no_main]

use libfuzzer_sys::fuzz_target;
use logs::{CarmenReader, LandmarkTable, ReadOptions};
use std::path::Path;

const LOG: &str = "FLASER 2 1.0 2.0 0 0 0 0 0 0 1.0 host 0\n\
    FLASER 2 1.0 2.1 1 0 0 1 0 0 2.0 host 0\n\
    FLASER 2 1.0 2.2 1 1 1 1 1 1 3.0 host 0\n";

fuzz_target!(|data: &[u8]| {
    let Ok(mut table) = LandmarkTable::read(data, Path::new("table")) else { return };
    let rows = table.len() as u64;
    let mut given = 0;
    for mut record in CarmenReader::new(LOG.as_bytes(), ReadOptions::default()) {
        table.give(&mut record);
        for sighting in &record.observation.sightings {
            given += 1;
            let covariance = &sighting.covariance;
            assert!(sighting.position.iter().chain(covariance.iter()).all(|v| v.is_finite()));
            assert!(covariance[(0, 0)] > 0.0 && covariance[(1, 1)] > 0.0);
        }
    }
    let report = table.finish();
    assert_eq!(report.sightings, given);
    assert!(given <= rows && rows <= given + report.dropped_count);
});
