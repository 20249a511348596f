use geometry::Vector2;
use manifoldslam_sensing::{LaserModel, Scan};
use proptest::prelude::*;

fn endpoint(scan: &Scan, i: usize) -> Vector2<f64> {
    let (sin, cos) = scan.laser().bearing(i).sin_cos();
    Vector2::new(cos, sin) * f64::from(scan.range(i))
}

proptest! {
    #[test]
    fn every_kth_beam_keeps_its_bearing_and_reading(
        readings in prop::collection::vec(0.0f32..50.0, 0..200),
        step in 0usize..9,
    ) {
        let scan = Scan::classify(LaserModel::half_circle(readings.len() as u32), &readings);
        let thin = scan.every(step);
        let step = step.max(1);
        prop_assert_eq!(thin.len(), readings.len().div_ceil(step));
        prop_assert_eq!(thin.laser().beams as usize, thin.len());
        for i in 0..thin.len() {
            prop_assert_eq!(thin.class(i), scan.class(i * step));
            prop_assert_eq!(thin.range(i), scan.range(i * step));
            prop_assert!((thin.laser().bearing(i) - scan.laser().bearing(i * step)).abs() < 1e-9);
        }
    }

    #[test]
    fn spaced_hits_are_spaced_and_leave_no_gap(
        readings in prop::collection::vec(0.0f32..50.0, 0..200),
        spacing in 0.01f64..2.0,
    ) {
        let scan = Scan::classify(LaserModel::half_circle(readings.len() as u32), &readings);
        let kept = scan.spaced_hits(spacing);
        prop_assert!(kept.windows(2).all(|w| w[0] < w[1]));
        prop_assert!(kept.iter().all(|&i| scan.hit(i).is_some()));
        let mut last = None;
        for i in (0..scan.len()).filter(|&i| scan.hit(i).is_some()) {
            let far = last.is_none_or(|l| (endpoint(&scan, i) - endpoint(&scan, l)).norm() >= spacing);
            prop_assert_eq!(far, kept.contains(&i), "beam {}", i);
            if far {
                last = Some(i);
            }
        }
    }
}
