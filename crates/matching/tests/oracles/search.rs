//! Branch and bound against looking at every pose.

use crate::rooms::{cloud, pair};
use geometry::{Pose2, Vector2};
use manifoldslam_matching::{
    LikelihoodPyramid, LikelihoodSettings, PointCloud, SearchSettings, SearchWindow,
};
use rand::{Rng, SeedableRng, rngs::StdRng};

fn points(cloud: &PointCloud, every: usize) -> Vec<Vector2<f32>> {
    cloud.points.iter().step_by(every).map(|p| p.position.cast()).collect()
}

fn window(centre: Pose2, half: f64, yaw_deg: f64) -> SearchWindow {
    let half_yaw_rad = yaw_deg.to_radians();
    SearchWindow { centre, half_x_m: half, half_y_m: 0.7 * half, half_yaw_rad }
}

#[test]
fn branch_and_bound_finds_the_exhaustive_optimum() {
    let mut rng = StdRng::seed_from_u64(1);
    for seed in 0..24 {
        let pair = pair(seed, 0.3, 15.0);
        let pyramid =
            LikelihoodPyramid::build(&cloud(&pair.reference), &LikelihoodSettings::default());
        let scan = points(&cloud(&pair.scan), 7);
        let truth = pair.truth();
        // Small and large windows, near the truth and far outside of the grid.
        let (half, yaw, off) =
            [(0.3, 12.0, 0.2), (0.9, 6.0, 0.5), (1.8, 2.0, 6.0), (0.2, 40.0, 9.0)]
                [seed as usize % 4];
        let centre = Pose2::new(
            truth.x + rng.random_range(-off..off),
            truth.y + rng.random_range(-off..off),
            truth.yaw + rng.random_range(-0.3..0.3),
        );
        let window = window(centre, half, yaw);
        let exact = pyramid.search_exhaustively(&scan, &window).unwrap();
        let found = pyramid.search(&scan, &window, 0.0).map_or(0.0, |c| c.score);
        assert_eq!(exact.score, found, "seed {seed}");
        if exact.score > 0.0 {
            let above = pyramid.search(&scan, &window, exact.score * 1.001 + 1e-3);
            assert_eq!(above, None, "seed {seed}: better than the best");
            assert!(pyramid.search(&scan, &window, exact.score * 0.999).is_some());
        }
    }
}

#[test]
fn several_candidates_are_the_greedy_choice_of_all_poses() {
    for seed in 0..6 {
        let pair = pair(seed, 0.4, 10.0);
        let pyramid =
            LikelihoodPyramid::build(&cloud(&pair.reference), &LikelihoodSettings::default());
        let scan = points(&cloud(&pair.scan), 20);
        let window = window(pair.truth(), 0.6, 6.0);
        let settings = SearchSettings {
            min_score: 0.05,
            candidates: 4,
            separation_m: 0.3,
            separation_rad: 0.08,
            ..SearchSettings::default()
        };
        let outcome = pyramid.search_many(&scan, &window, &settings);
        assert!(outcome.complete && outcome.candidates.len() == 4);
        for (i, candidate) in outcome.candidates.iter().enumerate() {
            let best = best_distinct(&pyramid, &scan, &window, &outcome.candidates[..i], &settings);
            assert!((candidate.score - best).abs() < 0.02, "{i}: {} {best}", candidate.score);
        }
    }
}

/// Best score of the poses in a window that are distinct from those given, pose by pose.
fn best_distinct(
    pyramid: &LikelihoodPyramid,
    scan: &[Vector2<f32>],
    window: &SearchWindow,
    taken: &[manifoldslam_matching::Candidate],
    settings: &SearchSettings,
) -> f32 {
    let mut best = 0f32;
    let reach = (window.half_x_m / 0.05, window.half_y_m / 0.05);
    let far = scan.iter().fold(0f32, |far, p| far.max(p.norm()));
    let step = (1.0 - 0.5 * (0.05 / f64::from(far)).powi(2)).acos();
    let turns = (window.half_yaw_rad / step) as i32;
    for dyaw in -turns..=turns {
        for dy in -(reach.1 as i32)..=reach.1 as i32 {
            for dx in -(reach.0 as i32)..=reach.0 as i32 {
                let pose = Pose2::new(
                    window.centre.x + 0.05 * f64::from(dx),
                    window.centre.y + 0.05 * f64::from(dy),
                    window.centre.yaw + step * f64::from(dyaw),
                );
                let distinct = taken.iter().all(|c| {
                    c.pose.distance(&pose) > settings.separation_m
                        || (c.pose.yaw - pose.yaw).abs() > settings.separation_rad
                });
                if distinct {
                    best = best.max(pyramid.score(scan, &pose));
                }
            }
        }
    }
    best
}

#[test]
fn any_yaw_and_five_metres_are_found() {
    let mut right = 0;
    for seed in 100..130 {
        let pair = pair(seed, 0.5, 20.0);
        let pyramid =
            LikelihoodPyramid::build(&cloud(&pair.reference), &LikelihoodSettings::default());
        let centre = Pose2::new(3.0, -4.0, 3.0);
        let found =
            pyramid.search(&points(&cloud(&pair.scan), 2), &window(centre, 7.0, 180.0), 0.4);
        let truth = pair.truth();
        right += usize::from(found.is_some_and(|c| {
            c.pose.distance(&truth) < 0.12 && (c.pose.yaw - truth.yaw).cos() > 0.999
        }));
    }
    println!("found {right} of 30");
    assert!(right >= 28, "{right} of 30");
}

#[test]
fn searches_have_a_limit_and_say_so() {
    let pair = pair(1, 0.3, 10.0);
    let pyramid = LikelihoodPyramid::build(&cloud(&pair.reference), &LikelihoodSettings::default());
    let settings = SearchSettings { max_windows: 50, min_score: 0.0, ..SearchSettings::default() };
    let scan = points(&cloud(&pair.scan), 5);
    let outcome = pyramid.search_many(&scan, &window(pair.truth(), 1e9, 1e9), &settings);
    assert!(!outcome.complete && outcome.windows < 100);
}

#[test]
fn empty_and_garbage_input_finds_nothing_or_something_finite() {
    let empty = LikelihoodPyramid::build(&PointCloud::default(), &LikelihoodSettings::default());
    let here = window(Pose2::IDENTITY, 0.5, 10.0);
    assert_eq!(empty.search(&[Vector2::new(1.0, 1.0)], &here, 0.1), None);
    assert_eq!(empty.search(&[], &here, 0.0), None);
    let pair = pair(1, 0.3, 10.0);
    let pyramid = LikelihoodPyramid::build(&cloud(&pair.reference), &LikelihoodSettings::default());
    let garbage = [
        Vector2::new(f32::NAN, 0.0),
        Vector2::new(f32::INFINITY, -1.0),
        Vector2::new(3e38, 3e38),
        Vector2::new(1.0, 2.0),
    ];
    for centre in
        [Pose2::IDENTITY, Pose2 { x: f64::NAN, y: 0.0, yaw: 0.0 }, Pose2::new(1e12, 0., 0.)]
    {
        if let Some(found) = pyramid.search(&garbage, &window(centre, 0.5, 10.0), 0.0) {
            assert!(found.score.is_finite() && found.pose.x.is_finite());
        }
    }
}

#[test]
fn two_levels_find_the_exhaustive_optimum() {
    for seed in 50..58 {
        let pair = pair(seed, 0.3, 15.0);
        let pyramid =
            LikelihoodPyramid::build(&cloud(&pair.reference), &LikelihoodSettings::default());
        let scan = points(&cloud(&pair.scan), 9);
        let window = window(Pose2::new(0.2, -0.1, 0.1), 0.7, 10.0);
        let exact = pyramid.search_exhaustively(&scan, &window).unwrap();
        let found = pyramid.search_two_levels(&scan, &window, 0.1).unwrap();
        assert_eq!(exact.score, found.score, "seed {seed}");
    }
}
