//! The thesis's perturbations (section 7.1): a match started from the truth moved by 0, 0.25 or
//! 0.5 m in eight directions and turned by up to 30 degrees.

use crate::rooms::{cloud, pair};
use geometry::{LieGroup, Pose2};
use manifoldslam_matching::{MatchResult, Matcher, PointCloud, Prior, matcher};

/// The thesis's measure of an error, `sqrt(dx^2 + dy^2 + (3 m)^2 dtheta^2)`, metres.
fn thesis_distance(found: &Pose2, truth: &Pose2) -> f64 {
    let error = truth.between(found).log();
    error.xy().norm().hypot(3.0 * error.z)
}

/// The starts of one cell of the thesis's tables, around the truth.
fn starts(truth: &Pose2, metres: f64, degrees: f64) -> Vec<Pose2> {
    let directions = if metres == 0.0 { 1 } else { 8 };
    let turns: &[f64] = if degrees == 0.0 { &[0.0] } else { &[-1.0, 1.0] };
    let mut starts = Vec::new();
    for k in 0..directions {
        let angle = f64::from(k) * std::f64::consts::FRAC_PI_4;
        for sign in turns {
            let yaw = truth.yaw + (sign * degrees).to_radians();
            starts.push(Pose2::new(
                truth.x + metres * angle.cos(),
                truth.y + metres * angle.sin(),
                yaw,
            ));
        }
    }
    starts
}

/// The results of one cell, each with its distance from the truth.
fn cell(
    matcher: &dyn Matcher,
    (reference, scan, truth): (&PointCloud, &PointCloud, &Pose2),
    (metres, degrees): (f64, f64),
) -> Vec<(f64, MatchResult)> {
    let starts = starts(truth, metres, degrees);
    let run = |start: &Pose2| {
        let result = matcher.align(reference, scan, &Prior::guess(*start));
        (thesis_distance(&result.pose, truth), result)
    };
    starts.iter().map(run).collect()
}

/// A cell over twelve pairs of rooms: root mean square distance and the share below 0.1 m.
fn rooms(name: &str, metres: f64, degrees: f64) -> (f64, f64) {
    let matcher = matcher(name).expect("a registered name");
    let mut found = Vec::new();
    for seed in 0..12 {
        let pair = pair(seed, 0.3, 10.0);
        let (a, b) = (cloud(&pair.reference), cloud(&pair.scan));
        found.extend(cell(matcher.as_ref(), (&a, &b, &pair.truth()), (metres, degrees)));
    }
    let n = found.len() as f64;
    let mean_square = found.iter().map(|(d, _)| d * d).sum::<f64>() / n;
    (mean_square.sqrt(), found.iter().filter(|(d, _)| *d < 0.1).count() as f64 / n)
}

/// The thesis prints 0.000000 for IDC, MbICP and WSM here.
#[test]
fn a_scan_finds_itself_to_six_decimals() {
    for name in ["icp", "idc", "mbicp", "plicp", "wsm", "wsm-thesis"] {
        let matcher = matcher(name).expect("a registered name");
        let turns: &[f64] = if name == "idc" { &[0.0, 15.0] } else { &[0.0] };
        for (seed, metres) in (0..8).flat_map(|seed| [(seed, 0.25), (seed, 0.5)]) {
            let scan = cloud(&pair(seed, 0.3, 10.0).scan);
            for degrees in turns {
                let clouds = (&scan, &scan, &Pose2::IDENTITY);
                for (distance, result) in cell(matcher.as_ref(), clouds, (metres, *degrees)) {
                    assert!(
                        distance < 5e-7 && result.status.is_usable(),
                        "{name}, {seed}, {metres} m, {degrees} deg: {distance:e} {result:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn equal_ranges_turn_what_closest_points_cannot() {
    for metres in [0.0, 0.25] {
        let (rms, idc) = rooms("idc", metres, 30.0);
        let (_, icp) = rooms("icp", metres, 30.0);
        println!("30 degrees, {metres} m: IDC finds {idc:.2} ({rms:.4}), ICP {icp:.2}");
        assert!(idc > 0.98 && icp < 0.8 && rms < 0.01, "{metres} m: {idc} {icp} {rms}");
    }
    for metres in [0.0, 0.25, 0.5] {
        let (rms, _) = rooms("idc", metres, 0.0);
        // The thesis's row of its first situation, IDC, on other scans.
        assert!(rms < 0.0067, "{metres} m: {rms}");
    }
}

/// The thesis's NDT ended farther off than it began in 20 of the 32 cells that begin off the truth.
#[test]
fn ndt_never_makes_a_cell_worse() {
    for name in ["ndt", "ndt-d2d"] {
        for degrees in [0.0, 15.0, 30.0f64] {
            for metres in [0.0, 0.25, 0.5f64] {
                let (rms, right) = rooms(name, metres, degrees);
                println!("{name}, {metres} m, {degrees} deg: {rms:.4} m, {right:.2} right");
                let start = metres.hypot(3.0 * degrees.to_radians());
                // From the truth itself there is no way but that of the noise.
                assert!(rms < start.max(0.01), "{name}, {metres} m, {degrees} deg: {rms}");
                assert!(degrees > 15.0 || right > 0.9, "{name}: {right}");
            }
        }
    }
}
