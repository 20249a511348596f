//! The Cramer-Rao bound, and every matcher's efficiency against it.

use crate::rooms::{cloud, scanner};
use geometry::{LieGroup, Matrix3, Pose2, Vector2, Vector3};
use manifoldslam_matching::{
    CloudPoint, MATCHER_NAMES, Matcher, PointCloud, Prior, cramer_rao_bound, fisher_information,
    matcher,
};
use synthetic::{RayCaster, Scanner, noisy_room_pair};

/// The true beams of a scan, those only that hit what `visible_from` sees as well.
fn truth(world: &RayCaster, scanner: &Scanner, pose: &Pose2, visible_from: &Pose2) -> PointCloud {
    let beams = scanner.truth(world, pose).into_iter().flatten();
    let points = beams.filter_map(|beam| {
        let ray = Vector2::new(beam.bearing.cos(), beam.bearing.sin());
        let position = ray * beam.range;
        let seen = visible_from.inverse().transform(pose.transform(position));
        let direction = visible_from.rotate(seen.normalize());
        let hit = world.cast(visible_from.translation(), direction, 80.0)?;
        let visible = (hit.range - seen.norm()).abs() < 0.02 && seen.x > 0.0;
        visible.then_some(CloudPoint {
            position,
            ray,
            range: beam.range,
            normal: Some(beam.normal),
            normal_variance: 0.0,
            line_distance: 0.0,
            beam_step: scanner.laser.angle_increment_rad,
            beam: 0,
        })
    });
    PointCloud { points: points.collect() }
}

#[test]
fn information_is_the_numeric_derivative_of_the_ranges() {
    let world = RayCaster::new(synthetic::noisy_room(7));
    let scanner = scanner();
    let pose = Pose2::new(0.2, 0.1, 0.7);
    let ranges = |delta: Vector3<f64>| scanner.truth(&world, &pose.retract(&delta));
    let here = ranges(Vector3::zeros());
    let h = 1e-5;
    let mut numeric = Matrix3::zeros();
    let mut smooth = Vec::new();
    for (i, beam) in here.iter().enumerate() {
        let Some(beam) = beam else { continue };
        let ray = Vector2::new(beam.bearing.cos(), beam.bearing.sin());
        if -beam.normal.dot(&ray) < 0.05 {
            continue;
        }
        let mut g = Vector3::zeros();
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = h;
            let (Some(a), Some(b)) = (ranges(step)[i], ranges(-step)[i]) else { continue };
            g[axis] = (a.range - b.range) / (2.0 * h);
        }
        if g.norm() > 100.0 {
            continue; // the step crossed an edge
        }
        numeric += g * g.transpose() / (0.02 * 0.02);
        smooth.push(CloudPoint::exact(ray, beam.range, beam.normal));
    }
    let analytic = fisher_information(&PointCloud { points: smooth }, 0.02, 0.0);
    let error = (analytic - numeric).norm() / numeric.norm();
    assert!(error < 1e-3, "{error}: {analytic} {numeric}");
}

#[test]
fn open_directions_have_no_bound() {
    let wall = |x: f64| CloudPoint {
        position: Vector2::new(x, 2.0),
        ray: Vector2::new(x, 2.0).normalize(),
        range: Vector2::new(x, 2.0).norm(),
        normal: Some(Vector2::new(0.0, -1.0)),
        normal_variance: 0.0,
        line_distance: 0.0,
        beam_step: 0.01,
        beam: 0,
    };
    let one_wall = PointCloud { points: (-5..6).map(|i| wall(f64::from(i) * 0.2)).collect() };
    assert_eq!(cramer_rao_bound(&fisher_information(&one_wall, 0.01, 0.0), 1), None);
}

/// Normalised squared error against the two-scan bound, over 3: 1 for an efficient matcher, and
/// never less. Returns the root of its trimmed mean and of its median over the median's
/// expectation.
fn efficiency(matcher: &dyn Matcher) -> (f64, f64, usize) {
    let scanner = scanner();
    let mut squares = Vec::new();
    let mut lost = 0;
    for seed in 2000..2120 {
        let pair = noisy_room_pair(seed, &scanner, 0.3, 10f64.to_radians());
        let prior = Prior::guess(Pose2::IDENTITY);
        let result = matcher.align(&cloud(&pair.reference), &cloud(&pair.scan), &prior);
        let error = result.pose.between(&pair.truth()).log();
        if !result.status.is_usable() || error.xy().norm() > 0.1 || error.z.abs() > 0.035 {
            lost += 1;
            continue;
        }
        let (a, b) = (&pair.world_from_reference, &pair.world_from_scan);
        let information = fisher_information(&truth(&pair.world, &scanner, b, a), 0.015, 0.0);
        let bound = cramer_rao_bound(&information, 1).expect("rooms leave nothing open");
        squares.push(error.dot(&(bound.try_inverse().expect("regular") * error)));
    }
    squares.sort_by(f64::total_cmp);
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    ((mean / 3.0).sqrt(), (squares[squares.len() / 2] / 2.366).sqrt(), lost)
}

#[test]
fn no_matcher_beats_the_bound() {
    for name in MATCHER_NAMES {
        let (rms, median, lost) = efficiency(matcher(name).unwrap().as_ref());
        println!("{name}: {rms:.2} x the two-scan bound (median {median:.2}), {lost} of 120 lost");
        // 120 pairs: the root of a mean of chi-squares / 3 has a standard deviation of 0.04.
        assert!(rms > 0.9 && median > 0.85, "{name} beats the bound: {rms} {median}");
        if ["wsm", "plicp", "vgicp", "fast"].contains(&name) {
            assert!(rms < 1.7, "{name}: {rms}");
        }
    }
}
