use manifoldslam_logs::{CarmenReader, ReadOptions};
use sensing::{LaserLimits, NoReturnDetector};
use std::path::PathBuf;

/// Scans, beams a scan, stamps that jump back, beams without return (as the data's description
/// counts).
const LOGS: [(&str, usize, usize, u64, usize); 3] = [
    ("intel", 13631, 180, 631, 68_313),
    ("aces", 7374, 180, 0, 11_139),
    ("mit-csail", 1988, 361, 0, 23_711),
];

fn logs() -> Vec<(PathBuf, usize, usize, u64, usize)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/laser-logs");
    let all = LOGS.map(|(name, scans, beams, back, none)| {
        (PathBuf::from(format!("{folder}/{name}.clf.bz2")), scans, beams, back, none)
    });
    let present: Vec<_> = all.into_iter().filter(|log| log.0.exists()).collect();
    if present.len() < LOGS.len() {
        eprintln!("skipped: the evaluation logs are not in ../shared/data/laser-logs");
    }
    present
}

#[test]
fn the_evaluation_logs_are_read_whole() {
    for (path, scans, beams, stamps_back, no_returns) in logs() {
        let mut reader = CarmenReader::open(&path, ReadOptions::default()).unwrap();
        let (mut count, mut without) = (0, 0);
        for record in reader.by_ref() {
            count += 1;
            let scan = &record.observation.scan;
            assert_eq!(scan.len(), beams);
            assert_eq!(record.observation.base_from_laser, geometry::Pose2::IDENTITY);
            without += scan.len() - scan.hit_count();
        }
        let report = reader.finish();
        assert_eq!((count, report.stamps_back), (scans, stamps_back), "{path:?}");
        assert!(without >= no_returns && without < no_returns * 3 / 2, "{path:?}: {without}");
        assert!(!report.is_lossy(), "{path:?}: {report:?}");
    }
}

/// Real surfaces are never taken for a code, and a code is found wherever a scanner would put it.
#[test]
fn no_return_codes_are_told_from_real_surfaces() {
    let limits =
        LaserLimits { range_max_m: 1000.0, detect_no_return: false, ..LaserLimits::default() };
    for (path, ..) in logs() {
        let options = ReadOptions { limits, ..ReadOptions::default() };
        let scans: Vec<Vec<f32>> = CarmenReader::open(&path, options)
            .unwrap()
            .map(|r| (0..r.observation.scan.len()).map(|i| r.observation.scan.range(i)).collect())
            .collect();
        assert_eq!(thresholds(&scans, |r| if r > 40.0 { 0.0 } else { r }), Vec::<f32>::new());
        for code in [4.0, 5.6, 8.0, 8.19, 16.0, 20.0, 30.0, 32.0] {
            let found = thresholds(&scans, |r| r.min(code));
            assert!(found.iter().all(|t| (code - t).abs() < 0.011), "{path:?} {code}: {found:?}");
            assert!(!found.is_empty(), "{path:?}: code {code} was not found");
        }
    }
}

/// All answers the detector gives while it reads the scans, changed by `edit`.
fn thresholds(scans: &[Vec<f32>], edit: impl Fn(f32) -> f32) -> Vec<f32> {
    let mut detector = NoReturnDetector::default();
    let mut answers = Vec::new();
    for block in scans.chunks(256) {
        for scan in block {
            let edited: Vec<f32> = scan.iter().map(|&r| edit(r)).collect();
            detector.observe(&edited);
        }
        answers.extend(detector.threshold());
    }
    answers
}
