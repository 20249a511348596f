use super::args::MatchersArgs;
use super::contender::{Contender, Pair, cloud};
use super::rooms::{near, scanner, seed};
use geometry::{LieGroup, Pose2, Vector3};
use indicatif::ProgressBar;
use matching::protocol::median;
use matching::{MatchResult, MatchStatus};
use rand::{Rng, SeedableRng, rngs::StdRng};
use rayon::prelude::*;
use serde::Serialize;
use synthetic::{RayCaster, Scanner, circular_room, corridor};

/// What every matcher said at one place with a direction that cannot be observed.
#[derive(Debug, Serialize)]
pub struct DegenerateResult {
    /// `plain corridor` or `round room`.
    pub name: String,
    /// The matchers, as they were named.
    pub matchers: Vec<DegenerateFigures>,
}

/// What one matcher said.
#[derive(Debug, Serialize)]
pub struct DegenerateFigures {
    /// The matcher.
    pub matcher: String,
    /// How its matches ended.
    #[serde(flatten)]
    pub statuses: Statuses,
    /// Median angle of the weak axes it named to the true one, degrees.
    pub weak_axis_off_deg: Option<f64>,
    /// Root mean square error along the directions that are observed, metres; a radian as 3 m.
    pub observed_rmse_m: f64,
}

/// How matches ended, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Statuses {
    /// Everything observed.
    pub converged: usize,
    /// One direction hardly observed.
    pub degenerate: usize,
    /// One of several answers that fit as well.
    pub ambiguous: usize,
    /// Too few points.
    pub too_few_points: usize,
    /// Lost.
    pub diverged: usize,
}

impl Statuses {
    /// Counts.
    pub fn of<'a>(results: impl IntoIterator<Item = &'a MatchResult>) -> Self {
        let mut counts = Statuses::default();
        for result in results {
            match result.status {
                MatchStatus::Converged => counts.converged += 1,
                MatchStatus::Degenerate { .. } => counts.degenerate += 1,
                MatchStatus::Ambiguous { .. } => counts.ambiguous += 1,
                MatchStatus::TooFewPoints => counts.too_few_points += 1,
                MatchStatus::Diverged => counts.diverged += 1,
            }
        }
        counts
    }
}

/// A match to be made where one direction is open.
struct Task {
    pair: Pair,
    guess: Pose2,
    /// The open direction, a unit vector `(x, y, yaw)` in the scan's frame.
    open: Vector3<f64>,
}

/// The corridor and the round room.
pub fn degenerate(
    args: &MatchersArgs,
    contenders: &[Contender],
    bar: &ProgressBar,
) -> Vec<DegenerateResult> {
    let scanner = scanner(args);
    let mut corridor_scanner = scanner;
    // Neither end of the corridor may be seen.
    corridor_scanner.noise.max_range = 20.0;
    let along = RayCaster::new(corridor(60.0, 2.0));
    let around = RayCaster::new(circular_room(4.0));
    let count = u64::from(args.rooms);
    let in_corridor: Vec<Task> =
        (0..count).map(|k| corridor_task(&along, &corridor_scanner, seed(args, k))).collect();
    let in_circle: Vec<Task> =
        (0..count).map(|k| circle_task(&around, &scanner, seed(args, k))).collect();
    vec![
        compare("plain corridor", &in_corridor, contenders, bar),
        compare("round room", &in_circle, contenders, bar),
    ]
}

fn corridor_task(world: &RayCaster, scanner: &Scanner, seed: u64) -> Task {
    let rng = &mut StdRng::seed_from_u64(seed);
    let mut pose = |x: f64| Pose2::new(x, rng.random_range(-0.3..0.3), rng.random_range(-0.3..0.3));
    let (reference, scan) = (pose(0.0), pose(0.3));
    let (s, c) = scan.yaw.sin_cos();
    task(world, scanner, &reference, &scan, Vector3::new(c, -s, 0.0), rng)
}

/// The scan is taken at the centre: what is open is its turn alone.
fn circle_task(world: &RayCaster, scanner: &Scanner, seed: u64) -> Task {
    let rng = &mut StdRng::seed_from_u64(seed);
    let heading = rng.random_range(-3.0..3.0);
    let reference = Pose2::new(rng.random_range(-0.2..0.2), rng.random_range(-0.2..0.2), heading);
    let scan = Pose2::new(0.0, 0.0, heading + rng.random_range(-0.2..0.2));
    task(world, scanner, &reference, &scan, Vector3::z(), rng)
}

fn task(
    world: &RayCaster,
    scanner: &Scanner,
    world_from_reference: &Pose2,
    world_from_scan: &Pose2,
    open: Vector3<f64>,
    rng: &mut StdRng,
) -> Task {
    let [reference, scan] = [world_from_reference, world_from_scan]
        .map(|pose| cloud(&scanner.scan(world, pose, rng), &Pose2::IDENTITY));
    let truth = world_from_reference.between(world_from_scan);
    let guess = near(&truth, rng);
    Task { pair: Pair { reference, scan, truth }, guess, open }
}

fn compare(
    name: &str,
    tasks: &[Task],
    contenders: &[Contender],
    bar: &ProgressBar,
) -> DegenerateResult {
    let matchers = contenders
        .iter()
        .map(|contender| {
            bar.set_message(format!("{name} {}", contender.name));
            let results: Vec<MatchResult> = tasks
                .par_iter()
                .map(|task| {
                    let (found, _) = contender.timed(&task.pair, &task.guess);
                    bar.inc(1);
                    found
                })
                .collect();
            sum_up(contender.name, tasks, &results)
        })
        .collect();
    DegenerateResult { name: name.to_owned(), matchers }
}

fn sum_up(name: &str, tasks: &[Task], results: &[MatchResult]) -> DegenerateFigures {
    let angles = results.iter().zip(tasks).filter_map(|(found, task)| match found.status {
        MatchStatus::Degenerate { weak_axis } => {
            Some(weak_axis.dot(&task.open).abs().min(1.0).acos().to_degrees())
        }
        _ => None,
    });
    let squares = results.iter().zip(tasks).map(|(found, task)| {
        let error = task.pair.truth.between(&found.pose).log();
        let observed = error - task.open * task.open.dot(&error);
        observed.component_mul(&Vector3::new(1.0, 1.0, 3.0)).norm_squared()
    });
    DegenerateFigures {
        matcher: name.to_owned(),
        statuses: Statuses::of(results),
        observed_rmse_m: (squares.sum::<f64>() / results.len().max(1) as f64).sqrt(),
        weak_axis_off_deg: median(angles),
    }
}
