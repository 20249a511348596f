use crate::read;
use manifoldslam_logs::{DropReason, LogRecord, read_tum};
use proptest::prelude::*;
use std::path::Path;

const LOG: &str = "# comment\n\
    PARAM robot_frontlaser_offset 0.0 nohost 0\n\
    FLASER 3 1.01 2.5 81.83 0 0 0.1 0.0 0.0 0.1 976052857.337530 nohost 0.000246\n\
    ODOM 0.1 0 0 0.1 0 0 976052857.437284 nohost 0.1\n\
    ROBOTLASER1 0 -1.5 3.0 1.5 80 0.01 0 3 1 2 3 1 7 0.5 0 0 0.5 0 0 0 0 0 0 0 976052858.1 h 0.2\n\
    RLASER 2 4.0 5.0 1 0 0.1 1.0 0.0 0.1 976052859.5 nohost 0.3\n\
    FLASER 4 1 2 3 4 2 0 0 2 0 0 976052860.000001 nohost 0.4";

/// What of a record cannot depend on lines that follow.
fn essence(records: &[LogRecord]) -> Vec<(u64, String, usize)> {
    records.iter().map(|r| (r.line, r.stamp_text.clone(), r.observation.scan.len())).collect()
}

#[test]
fn every_truncation_gives_a_prefix() {
    let (records, _) = read(LOG);
    let whole = essence(&records);
    assert_eq!(whole.len(), 4);
    let mut truncated = 0;
    for end in 0..LOG.len() {
        let (records, report) = read(&LOG[..end]);
        let part = essence(&records);
        assert_eq!(part, whole[..part.len()], "cut at {end}: {}", &LOG[..end]);
        let lines = LOG[..end].matches('\n').count();
        assert!(part.len() >= lines.saturating_sub(2).min(4) / 2, "cut at {end}");
        if report.dropped_count > 0 {
            assert_eq!(
                (report.dropped_count, &report.dropped[0].reason),
                (1, &DropReason::Truncated)
            );
            truncated += 1;
        }
    }
    assert!(truncated > 200, "only {truncated} cuts were noticed");
}

#[test]
fn every_byte_flip_is_survived() {
    let whole = LOG.as_bytes();
    for i in 0..whole.len() {
        for mask in [0x01, 0x10, 0x40, 0x80, 0xff] {
            let mut bytes = whole.to_vec();
            bytes[i] ^= mask;
            let (records, report) = read(&bytes);
            assert!(records.len() <= 5 && records.len() as u64 == report.scans);
            for record in &records {
                let scan = &record.observation.scan;
                assert!((0..scan.len()).all(|k| scan.range(k).is_finite()));
                assert!(record.observation.base_from_laser.norm() <= 100.0);
            }
        }
    }
}

/// What a damaged log may consist of.
const WORDS: &str = "FLASER|RLASER|ROBOTLASER1|ODOM|PARAM|[0-9]{1,3}|-?[0-9.]{1,9}|nan|inf|\n";

proptest! {
    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        let (records, report) = read(&bytes);
        prop_assert_eq!(records.len() as u64, report.scans);
        let _ = read_tum(&bytes[..], Path::new("any"));
    }

    #[test]
    fn any_words_are_survived(
        words in prop::collection::vec(WORDS, 0..300),
    ) {
        let (records, report) = read(words.join(" "));
        prop_assert_eq!(records.len() as u64, report.scans);
    }
}
