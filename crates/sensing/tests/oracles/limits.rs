use manifoldslam_sensing::{LaserLimits, NoReturnDetector};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

/// Scans of 180 beams: surfaces up to `reach_m` in centimetres, and a share of beams without
/// return.
fn scans(reach_m: f32, code_m: f32, share: f64, count: usize, seed: u64) -> Vec<Vec<f32>> {
    let mut rng = StdRng::seed_from_u64(seed);
    let beam = |rng: &mut StdRng| {
        // Near surfaces are more common than far ones.
        let range = reach_m * rng.random_range(0.0f32..1.0).powi(3);
        if rng.random_bool(share) { code_m } else { (range * 100.0).round() / 100.0 }
    };
    (0..count).map(|_| (0..180).map(|_| beam(&mut rng)).collect()).collect()
}

fn threshold(scans: &[Vec<f32>]) -> Option<f32> {
    let mut detector = NoReturnDetector::default();
    scans.iter().for_each(|scan| detector.observe(scan));
    detector.threshold()
}

#[test]
fn codes_of_common_scanners_are_found() {
    for (reach, code) in [
        (26.37, 81.83),
        (42.4, 81.91),
        (49.0, 50.0),
        (7.5, 8.0),
        (8.0, 8.19),
        (15.9, 16.0),
        (30.0, 32.0),
        (5.59, 5.6),
        (29.99, 30.0),
        (3.99, 4.095),
    ] {
        for share in [0.01, 0.05, 0.4, 0.9] {
            let found = threshold(&scans(reach, code, share, 256, 1)).unwrap_or(f32::NAN);
            assert!(found <= code && found > code - 0.011, "code {code} share {share}: {found}");
        }
    }
}

#[test]
fn a_few_glitches_beyond_do_not_hide_the_code() {
    let mut log = scans(7.5, 8.0, 0.05, 256, 2);
    log[3][10] = 12.34;
    log[100][90] = 31.0;
    log[200][91] = 31.0;
    let found = threshold(&log).unwrap();
    assert!((found - 7.995).abs() < 1e-3, "{found}");
}

#[test]
fn surfaces_alone_are_no_code() {
    for seed in 0..20 {
        assert_eq!(threshold(&scans(30.0, 0.0, 0.0, 256, seed)), None);
        assert_eq!(threshold(&scans(6.0, 0.0, 0.0, 256, seed)), None);
    }
}

#[test]
fn a_far_wall_stared_at_is_no_code() {
    // A standing robot, without noise: twelve beams see the corridor's end at 17.12 m in every
    // scan.
    let scan: Vec<f32> = (0..180)
        .map(|i| if (84..96).contains(&i) { 17.12 } else { 2.0 + i as f32 * 0.01 })
        .collect();
    assert_eq!(threshold(&vec![scan; 256]), None);
}

#[test]
fn nonsense_is_not_looked_at() {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e30, 100.0, 99.999];
    let scan: Vec<f32> = bad.iter().copied().cycle().take(180).collect();
    let mut detector = NoReturnDetector::default();
    for _ in 0..300 {
        detector.observe(&scan);
        detector.observe(&[]);
    }
    let found = detector.threshold();
    assert!(found.is_none_or(|t| t > 99.9), "{found:?}");
}

#[test]
fn the_least_limit_rules() {
    let limits = LaserLimits::default();
    assert_eq!(limits.range_max(None, None), 40.0);
    assert_eq!(limits.range_max(Some(81.9), None), 40.0);
    assert_eq!(limits.range_max(Some(8.0), None), 7.992);
    assert_eq!(limits.range_max(Some(30.0), Some(8.185)), 8.185);
    assert_eq!(limits.range_max(Some(0.0), Some(f32::NAN)), 40.0);
    assert_eq!(limits.range_max(Some(-1.0), None), 40.0);
    assert!(limits.problems().is_empty());
    let bad = LaserLimits { range_min_m: -1.0, range_max_m: f32::NAN, ..limits };
    assert_eq!(bad.problems().len(), 2);
}
