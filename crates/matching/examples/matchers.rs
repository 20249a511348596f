//! Every matcher on 100 pairs of noisy synthetic rooms (361 beams, 15 mm of noise, 0.3 m and 10
//! degrees apart, starting from the identity): error, time, and WSM against a submap of six scans.
//!
//! `cargo run --release -p manifoldslam-matching --example matchers`

use geometry::{LieGroup, Pose2};
use manifoldslam_matching::{MATCHER_NAMES, PointCloud, PointCloudSettings, Prior, matcher};
use rand::{SeedableRng, rngs::StdRng};
use std::time::Instant;
use synthetic::{LaserNoise, Scanner, noisy_room_pair};

const PAIRS: u64 = 100;

fn main() {
    let scanner = Scanner::half_circle(361, LaserNoise::gaussian(0.015));
    for scans in [1, 6] {
        for name in MATCHER_NAMES {
            measure(name, &scanner, scans);
        }
    }
}

fn measure(name: &str, scanner: &Scanner, scans: usize) {
    let matcher = matcher(name).expect("a registered name");
    let (mut errors, mut yaws, mut times, mut lost) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for seed in 3000..3000 + PAIRS {
        let pair = noisy_room_pair(seed, scanner, 0.3, 10f64.to_radians());
        let mut reference = cloud(&pair.reference);
        let mut rng = StdRng::seed_from_u64(seed);
        for k in 1..scans {
            let step = Pose2::new(0.1 * k as f64, 0.05, 0.05 * k as f64);
            let scan = scanner.scan(&pair.world, &(pair.world_from_reference * step), &mut rng);
            reference.extend(&cloud(&scan).transformed(&step));
        }
        let scan = cloud(&pair.scan);
        let mut best = f64::INFINITY;
        let mut result = None;
        for _ in 0..3 {
            let start = Instant::now();
            result = Some(matcher.align(&reference, &scan, &Prior::guess(Pose2::IDENTITY)));
            best = best.min(start.elapsed().as_secs_f64());
        }
        let Some(result) = result else { continue };
        let error = result.pose.between(&pair.truth()).log();
        times.push(1e3 * best);
        errors.push(1e3 * error.xy().norm());
        yaws.push(error.z.abs().to_degrees());
        lost += usize::from(error.xy().norm() > 0.1 || !result.status.is_usable());
    }
    let [error, yaw, time] = [errors, yaws, times].map(median);
    println!(
        "{name:17} against {scans} scan(s): {error:5.2} mm {yaw:.4} deg, {time:.3} ms, {lost} of \
         {PAIRS} lost"
    );
}

fn cloud(scan: &sensing::Scan) -> PointCloud {
    PointCloud::from_scan(scan, &Pose2::IDENTITY, &PointCloudSettings::default())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
