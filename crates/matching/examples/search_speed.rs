//! How fast wide searches are: a scan in a two-loop building against a submap of 12 scans.
//!
//! `cargo run --release -p manifoldslam-matching --example search_speed`

use geometry::{Pose2, Vector2};
use manifoldslam_matching::{
    LikelihoodPyramid, LikelihoodSettings, PointCloud, PointCloudSettings, SearchSettings,
    SearchWindow,
};
use std::time::Instant;

fn main() {
    let run = synthetic::two_loop_building(1);
    let clouds: Vec<_> = run
        .observations
        .iter()
        .map(|o| PointCloud::from_scan(&o.scan, &o.base_from_laser, &PointCloudSettings::default()))
        .collect();
    for (half, yaw) in [(0.5, 30.0f64), (2.0, 45.0), (5.0, 180.0), (10.0, 180.0)] {
        let mut build = Vec::new();
        let mut times = Vec::new();
        let (mut right, mut windows, mut n) = (0, 0, 0);
        for start in (0..run.truth.len() - 40).step_by(37) {
            let anchor = run.truth[start];
            let mut submap = PointCloud::default();
            for k in (start..start + 36).step_by(3) {
                submap.extend(&clouds[k].transformed(&anchor.between(&run.truth[k])));
            }
            let t = Instant::now();
            let pyramid = LikelihoodPyramid::build(&submap, &LikelihoodSettings::default());
            build.push(t.elapsed().as_secs_f64() * 1e3);
            let query = start + 20;
            let truth = anchor.between(&run.truth[query]);
            let points: Vec<Vector2<f32>> =
                clouds[query].points.iter().map(|p| p.position.cast()).collect();
            let centre = Pose2::new(truth.x + 0.6 * half, truth.y - 0.4 * half, truth.yaw + 0.3);
            let window = SearchWindow {
                centre,
                half_x_m: half,
                half_y_m: half,
                half_yaw_rad: yaw.to_radians(),
            };
            let settings = SearchSettings { min_score: 0.5, ..SearchSettings::default() };
            let t = Instant::now();
            let outcome = pyramid.search_many(&points, &window, &settings);
            times.push(t.elapsed().as_secs_f64() * 1e3);
            windows += outcome.windows;
            n += 1;
            right += usize::from(
                outcome.candidates.first().is_some_and(|c| c.pose.distance(&truth) < 0.15),
            );
        }
        build.sort_by(f64::total_cmp);
        times.sort_by(f64::total_cmp);
        println!(
            "+-{half} m, +-{yaw} deg: build {:.2} ms, search median {:.3} ms, worst {:.3} ms, \
             {} windows, {right} of {n} right",
            build[n / 2],
            times[n / 2],
            times[n - 1],
            windows / n
        );
    }
}
