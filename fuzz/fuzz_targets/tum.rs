//! Any bytes as a trajectory; what was read is written and read again. The same bytes as relations.
#![no_main]

use libfuzzer_sys::fuzz_target;
use logs::{read_relations, read_tum, write_tum};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let name = Path::new("fuzz");
    if let Ok(relations) = read_relations(data, name) {
        assert!(
            relations.iter().all(|r| r.from_secs.is_finite() && r.from_from_to.yaw.is_finite())
        );
    }
    let Ok(poses) = read_tum(data, name) else { return };
    let mut text = Vec::new();
    write_tum(&mut text, poses.iter().map(|p| (p.stamp_text.as_str(), p.pose)))
        .expect("memory can be written");
    let again = read_tum(&text[..], name).expect("what was written can be read");
    assert_eq!(again.len(), poses.len());
    for (a, b) in again.iter().zip(&poses) {
        assert_eq!(a.stamp_text, b.stamp_text);
        assert!(a.pose.distance(&b.pose) < 1e-6);
        let turn = (a.pose.yaw - b.pose.yaw).sin().abs();
        assert!(turn < 1e-9, "turned by {turn}");
    }
});
