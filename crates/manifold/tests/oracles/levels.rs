//! Levels of buildings drawn by hand.

use crate::graphs::add_patch;
use geometry::{GaussianPose2, Matrix3, Pose2};
use manifoldslam_manifold::{Elevation, GroundKind, Levels, Manifold, PatchId, Provenance};

/// A drive through patches a metre apart with these heights, `None` where nothing tells.
fn drive(heights_m: &[Option<f64>]) -> Levels {
    let mut manifold = Manifold::new();
    manifold.add_robot("one");
    let step =
        GaussianPose2 { mean: Pose2::new(1.0, 0.0, 0.0), covariance: Matrix3::identity() * 1e-4 };
    for (k, height_m) in heights_m.iter().enumerate() {
        let id = add_patch(&mut manifold, Pose2::new(k as f64, 0.0, 0.0));
        if let Some(height_m) = *height_m {
            manifold.elevate(vec![(id, Elevation { height_m, variance_m2: 1e-4 })]);
        }
        if k > 0 {
            manifold.relate(PatchId(k as u32 - 1), id, step, Provenance::Sequential);
        }
    }
    manifold.levels(&manifold.islands()[0])
}

/// Heights along straight pieces: each goes from its first height to its second in so many steps.
fn profile(pieces: &[(f64, f64, usize)]) -> Vec<Option<f64>> {
    let piece = |&(from, to, steps): &(f64, f64, usize)| {
        (0..steps).map(move |k| Some(from + (to - from) * k as f64 / steps as f64))
    };
    pieces.iter().flat_map(piece).collect()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 0.05
}

#[test]
fn a_ramp_joins_two_levels_and_makes_none() {
    let levels = drive(&profile(&[(0.0, 0.0, 20), (0.0, 3.0, 18), (3.0, 3.0, 15)]));
    let [low, high] = levels.heights_m[..] else { panic!("{levels:?}") };
    assert!(near(low, 0.0) && near(high, 3.0), "{levels:?}");
    let of = |k: u32| levels.of(PatchId(k)).expect("a member");
    assert!((0..19).all(|k| (of(k).level, of(k).ground) == (0, GroundKind::Flat)));
    assert!((22..37).all(|k| of(k).ground == GroundKind::Ramp));
    assert!((20..28).all(|k| of(k).level == 0) && (31..37).all(|k| of(k).level == 1));
    assert!((40..53).all(|k| (of(k).level, of(k).ground) == (1, GroundKind::Flat)));
    assert_eq!(levels.patches(0).count() + levels.patches(1).count(), 53);
}

/// Half way up one turns round on a landing, longer than some floors.
#[test]
fn a_landing_is_no_level() {
    let levels = drive(&profile(&[
        (0.0, 0.0, 20),
        (0.0, 1.5, 9),
        (1.5, 1.5, 8),
        (1.5, 3.0, 9),
        (3.0, 3.0, 20),
    ]));
    assert_eq!(levels.heights_m.len(), 2, "{levels:?}");
    assert!((31..35).all(|k| levels.of(PatchId(k)).expect("a member").ground == GroundKind::Ramp));
}

#[test]
fn heights_that_drift_are_one_level() {
    let levels = drive(&profile(&[(0.0, 0.6, 60), (0.6, 0.1, 60)]));
    assert_eq!(levels.heights_m.len(), 1, "{levels:?}");
}

#[test]
fn unknown_heights_are_those_of_the_neighbours() {
    let mut heights = profile(&[(0.0, 0.0, 20), (0.0, 3.0, 18), (3.0, 3.0, 15)]);
    for unknown in [3, 4, 45, 46, 47] {
        heights[unknown] = None;
    }
    let levels = drive(&heights);
    assert_eq!(levels.heights_m.len(), 2);
    assert!([3, 4].iter().all(|&k| levels.of(PatchId(k)).expect("a member").level == 0));
    assert!([45, 46, 47].iter().all(|&k| levels.of(PatchId(k)).expect("a member").level == 1));
    let flat = drive(&[None; 12]);
    assert_eq!(flat.heights_m, [0.0]);
    assert!(flat.members.iter().all(|m| (m.level, m.ground) == (0, GroundKind::Flat)));
}
