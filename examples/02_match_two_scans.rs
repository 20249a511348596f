//! Where was the second scan taken, seen from the first, and how sure is that? In a room, and in a
//! corridor, where one direction cannot be known.
//!
//! `cargo run --release -p manifoldslam --example 02_match_two_scans`

use geometry::{GaussianPose2, Pose2};
use matching::{MATCHER_NAMES, MatchStatus, PointCloud, PointCloudSettings, Prior, matcher};
use rand::{SeedableRng, rngs::StdRng};
use sensing::Scan;
use synthetic::{FloorPlan, LaserNoise, RayCaster, Scanner, noisy_room_pair};

fn main() {
    let scanner = Scanner::half_circle(361, LaserNoise::gaussian(0.01));
    for name in MATCHER_NAMES {
        room(name, &scanner);
    }
    corridor(&scanner);
}

/// All matchers stand behind one trait and are selected by name.
fn room(name: &str, scanner: &Scanner) {
    let pair = noisy_room_pair(5, scanner, 0.2, 0.1);
    let (reference, scan) = (cloud(&pair.reference), cloud(&pair.scan));

    // A prior without information is a starting point, nothing more.
    let matcher = matcher(name).expect("a registered name");
    let found = matcher.align(&reference, &scan, &Prior::guess(Pose2::IDENTITY));

    // The answer is never a bare pose: it comes with its covariance (a right perturbation, in the
    // scan's frame), the share of the scan that fits, and how the match ended.
    assert_eq!(found.status, MatchStatus::Converged);
    let error = found.pose.distance(&pair.truth());
    let claim = (found.covariance[(0, 0)] + found.covariance[(1, 1)]).sqrt();
    println!(
        "{name:17} off by {:4.1} mm, claims {:4.1} mm, {:3.0} % of the scan fits",
        1e3 * error,
        1e3 * claim,
        100.0 * found.inlier_ratio
    );
    assert!(error < 0.02, "{name} is {error} m off");
    if name == "wsm" {
        // The Weighted Scan Matcher's covariance is calibrated: the error lies within it.
        let believed = GaussianPose2 { mean: found.pose, covariance: found.covariance };
        let distance2 = believed.mahalanobis_squared(&pair.truth()).expect("a regular covariance");
        assert!(distance2 < 16.27, "beyond the 99.9 % quantile of chi-squared, 3 dof");
    }
}

/// Two scans in a corridor whose ends are out of sight: nothing tells how far the robot drove.
fn corridor(scanner: &Scanner) {
    let mut plan = FloorPlan::new();
    plan.wall((-200.0, 1.0), (200.0, 1.0)).wall((-200.0, -1.0), (200.0, -1.0));
    let world = RayCaster::new(plan);
    let mut rng = StdRng::seed_from_u64(7);
    let truth = Pose2::new(0.15, 0.05, 0.04);
    let reference = cloud(&scanner.scan(&world, &Pose2::IDENTITY, &mut rng));
    let scan = cloud(&scanner.scan(&world, &truth, &mut rng));

    let found = matcher("wsm").expect("a registered name").align(
        &reference,
        &scan,
        &Prior::guess(Pose2::IDENTITY),
    );
    // Not an error, not a wrong answer told with confidence: a value that says what it lacks.
    let MatchStatus::Degenerate { weak_axis } = found.status else {
        panic!("a corridor must be called degenerate, not {:?}", found.status)
    };
    println!("corridor: degenerate along {:.2} {:.2} {:.2}", weak_axis.x, weak_axis.y, weak_axis.z);
    assert!(weak_axis.x.abs() > 0.95, "the weak axis points along the corridor");
    assert!((found.pose.yaw - truth.yaw).abs() < 0.01, "yaw is known all the same");
}

fn cloud(scan: &Scan) -> PointCloud {
    PointCloud::from_scan(scan, &Pose2::IDENTITY, &PointCloudSettings::default())
}
