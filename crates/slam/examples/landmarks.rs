//! How often, how well and how safely two islands are joined by landmarks alone.
//!
//! `cargo run --release --locked -p manifoldslam-slam --example landmarks -- [seeds]`; see
//! bench/landmarks/README.md.

use geometry::{Matrix2, Pose2, Vector2};
use manifold::PatchId;
use manifoldslam_slam::{
    IslandLandmark, IslandLandmarks, LandmarkAlignment, LandmarkSettings, compare_landmarks,
};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use sensing::LandmarkKind;
use synthetic::standard_normal;

/// Side of the square the tags lie in, metres.
const SIDE_M: f64 = 30.0;
/// A merge farther off than this is a false one: no noise of the table explains it.
const FALSE_M: f64 = 1.5;

struct Case {
    tags: usize,
    wrong: f64,
    std_m: f64,
    /// Range error is so many times as large as that across.
    stretch: f64,
}

#[derive(Default)]
struct Row {
    merged: usize,
    wrong_merges: usize,
    provisional: usize,
    accurate: usize,
    errors_m: Vec<f64>,
    errors_deg: Vec<f64>,
    wrong_ids: usize,
    wrong_refused: usize,
}

fn main() {
    let seeds = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(200);
    println!(
        "| tags | wrong ids | noise, m | merged | provisional | false | < 0.1 m, 1 deg \
         | median, m | 95 %, m | 95 %, deg | wrong ids refused |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for (std_m, stretch) in [(0.02, 1.0), (0.05, 1.0), (0.1, 1.0), (0.2, 1.0), (0.05, 10.0)] {
        for tags in [2, 3, 10] {
            for wrong in [0.0, 0.1, 0.3] {
                let case = Case { tags, wrong, std_m, stretch };
                let row = run(&case, seeds);
                row.print(&case, seeds);
            }
        }
    }
}

fn run(case: &Case, seeds: u64) -> Row {
    let mut row = Row::default();
    let settings = LandmarkSettings::default();
    for seed in 0..seeds {
        let (target, source, truth, wrong) = world(case, seed);
        row.wrong_ids += wrong.iter().filter(|w| **w).count();
        let found = compare_landmarks(&target, &source, &settings);
        let merge = found.as_ref().filter(|f| f.false_bound <= settings.false_merges);
        row.provisional += usize::from(found.is_some() && merge.is_none());
        row.wrong_refused += wrong
            .iter()
            .enumerate()
            .filter(|(i, w)| **w && merge.is_none_or(|m| m.pairs.iter().all(|p| p.1 != *i)))
            .count();
        if let Some(merge) = merge {
            row.note(merge, &truth);
        }
    }
    row
}

/// Two islands that saw the same tags, the pose between them and which of the source's ids are
/// wrong.
fn world(case: &Case, seed: u64) -> (IslandLandmarks, IslandLandmarks, Pose2, Vec<bool>) {
    let mut rng = StdRng::seed_from_u64(seed);
    let spot = |rng: &mut StdRng| Vector2::new(rng.random::<f64>(), rng.random::<f64>()) * SIDE_M;
    let tags: Vec<_> = (0..case.tags).map(|_| spot(&mut rng)).collect();
    let truth = Pose2::new(
        rng.random::<f64>() * 50.0 - 25.0,
        rng.random::<f64>() * 50.0 - 25.0,
        rng.random::<f64>() * 6.0,
    );
    let (mut target, mut source, mut wrongs) = (Vec::new(), Vec::new(), Vec::new());
    for (i, tag) in tags.iter().enumerate() {
        let id = i.to_string();
        target.push(sighted(*tag, &id, case, &mut rng));
        let wrong = rng.random::<f64>() < case.wrong;
        // A tag of another place that answers with this id.
        let seen = if wrong { spot(&mut rng) } else { *tag };
        source.push(sighted(truth.inverse().transform(seen), &id, case, &mut rng));
        wrongs.push(wrong);
    }
    (island(target), island(source), truth, wrongs)
}

/// A tag seen once from 3 m away, from any side, with an error along the sight line and across.
fn sighted(at: Vector2<f64>, id: &str, case: &Case, rng: &mut StdRng) -> IslandLandmark {
    let yaw = rng.random::<f64>() * 6.0;
    let (along, across) = (case.std_m * case.stretch, case.std_m);
    let robot = Pose2::new(at.x, at.y, yaw) * Pose2::new(-3.0, 0.0, 0.0);
    let error = Vector2::new(along * standard_normal(rng), across * standard_normal(rng));
    IslandLandmark {
        kind: LandmarkKind::Tag,
        id: Some(id.into()),
        patch: PatchId(0),
        island_from_patch: robot,
        position: Vector2::new(3.0, 0.0) + error,
        covariance: Matrix2::new(along * along, 0.0, 0.0, across * across),
        yaw: None,
        sightings: 1,
        robots: vec![sensing::RobotId(0)],
    }
}

fn island(landmarks: Vec<IslandLandmark>) -> IslandLandmarks {
    let drift = vec![Matrix2::zeros(); landmarks.len() * landmarks.len()];
    IslandLandmarks { landmarks, drift, area_m2: SIDE_M * SIDE_M }
}

impl Row {
    fn note(&mut self, merge: &LandmarkAlignment, truth: &Pose2) {
        let pose = &merge.target_from_source.mean;
        // Where it counts: in the middle of the tags.
        let middle = truth.inverse().transform(Vector2::new(0.5, 0.5) * SIDE_M);
        let error_m = (pose.transform(middle) - truth.transform(middle)).norm();
        let error_deg = truth.between(pose).yaw.abs().to_degrees();
        self.merged += 1;
        self.wrong_merges += usize::from(error_m > FALSE_M);
        self.accurate += usize::from(error_m < 0.1 && error_deg < 1.0);
        self.errors_m.push(error_m);
        self.errors_deg.push(error_deg);
    }

    fn print(&self, case: &Case, seeds: u64) {
        let noise = match case.stretch {
            1.0 => format!("{}", case.std_m),
            stretch => format!("{} x {}", case.std_m * stretch, case.std_m),
        };
        println!(
            "| {} | {:.0} % | {noise} | {:.1} % | {:.1} % | {} of {seeds} | {:.1} % | {} | {} \
             | {} | {} of {} |",
            case.tags,
            100.0 * case.wrong,
            100.0 * self.merged as f64 / seeds as f64,
            100.0 * self.provisional as f64 / seeds as f64,
            self.wrong_merges,
            100.0 * self.accurate as f64 / seeds as f64,
            quantile(&self.errors_m, 0.5),
            quantile(&self.errors_m, 0.95),
            quantile(&self.errors_deg, 0.95),
            self.wrong_refused,
            self.wrong_ids,
        );
    }
}

/// A quantile with three decimals; a dash where there is none.
fn quantile(values: &[f64], share: f64) -> String {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let value = sorted.get((share * sorted.len() as f64) as usize);
    value.map_or("-".into(), |v| format!("{v:.3}"))
}
