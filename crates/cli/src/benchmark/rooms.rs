use super::accuracy::{Accuracy, Attempt};
use super::args::MatchersArgs;
use super::contender::{Contender, Pair, cloud};
use super::visible::visible_bound;
use geometry::{Matrix3, Pose2};
use indicatif::ProgressBar;
use matching::PointCloud;
use rand::{Rng, SeedableRng, rngs::StdRng};
use rayon::prelude::*;
use serde::Serialize;
use synthetic::{LaserNoise, RayCaster, Scanner, noisy_room, noisy_room_pair};

/// Range noise where none is asked for, metres.
const RANGE_STD_M: f64 = 0.015;
/// Scans that a submap is made of.
const SUBMAP_SCANS: usize = 6;
/// Distance and turn of the guess from the truth: that of a robot that tracks its pose.
const GUESS: (f64, f64) = (0.03, 0.6);

/// Accuracy of every matcher at one kind of place.
#[derive(Debug, Serialize)]
pub struct AccuracyResult {
    /// `rooms` or `submap`.
    pub name: String,
    /// Standard deviation of a range, metres.
    pub range_std_m: f64,
    /// The matchers, as they were named.
    pub matchers: Vec<NamedAccuracy>,
}

/// Accuracy of one matcher.
#[derive(Debug, Serialize)]
pub struct NamedAccuracy {
    /// The matcher.
    pub matcher: String,
    /// Its figures.
    #[serde(flatten)]
    pub accuracy: Accuracy,
}

/// Something to match with the guess to start from.
struct Task {
    pair: Pair,
    guess: Pose2,
    bound: Option<Matrix3<f64>>,
}

/// The scanner of the rooms.
pub fn scanner(args: &MatchersArgs) -> Scanner {
    Scanner::half_circle(361, LaserNoise::gaussian(args.noise.unwrap_or(RANGE_STD_M)))
}

/// Seed of the k-th room.
pub fn seed(args: &MatchersArgs, k: u64) -> u64 {
    args.seed.wrapping_mul(1_000_003).wrapping_add(k)
}

/// A guess in a random direction from the truth.
pub fn near(truth: &Pose2, rng: &mut StdRng) -> Pose2 {
    let direction: f64 = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
    let side = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let (distance, turn) = GUESS;
    let (s, c) = direction.sin_cos();
    *truth * Pose2::new(distance * c, distance * s, side * turn.to_radians())
}

/// Scan to scan in random rooms, 0.3 m and 10 degrees apart.
pub fn rooms(args: &MatchersArgs, contenders: &[Contender], bar: &ProgressBar) -> AccuracyResult {
    compare("rooms", args, contenders, bar, |k| {
        let (scanner, seed) = (scanner(args), seed(args, k));
        let pair = noisy_room_pair(seed, &scanner, 0.3, 10_f64.to_radians());
        let (reference, scan) = (&pair.world_from_reference, &pair.world_from_scan);
        let bound = visible_bound(&pair.world, &scanner, scan, &[*reference]);
        let truth = pair.truth();
        let [reference, scan] =
            [&pair.reference, &pair.scan].map(|scan| cloud(scan, &Pose2::IDENTITY));
        let guess = near(&truth, &mut StdRng::seed_from_u64(seed ^ 0x57A7));
        Task { pair: Pair { reference, scan, truth }, guess, bound }
    })
}

/// A scan against six others at their true poses, in random rooms.
pub fn submap(args: &MatchersArgs, contenders: &[Contender], bar: &ProgressBar) -> AccuracyResult {
    compare("submap", args, contenders, bar, |k| {
        let (scanner, seed) = (scanner(args), seed(args, k));
        let rng = &mut StdRng::seed_from_u64(seed ^ 0x5B_3A77);
        let world = RayCaster::new(noisy_room(seed));
        let heading = rng.random_range(-3.1..3.1);
        let mut pose = || {
            let mut within = |reach: f64| rng.random_range(-reach..reach);
            Pose2::new(within(0.6), within(0.6), heading + within(0.3))
        };
        let poses: Vec<Pose2> = (0..SUBMAP_SCANS).map(|_| pose()).collect();
        let truth = pose();
        let mut reference = PointCloud::default();
        let mut see = |pose: &Pose2| cloud(&scanner.scan(&world, pose, rng), &Pose2::IDENTITY);
        for pose in &poses {
            reference.extend(&see(pose).transformed(pose));
        }
        let scan = see(&truth);
        let bound = visible_bound(&world, &scanner, &truth, &poses);
        let guess = near(&truth, rng);
        Task { pair: Pair { reference, scan, truth }, guess, bound }
    })
}

fn compare(
    name: &str,
    args: &MatchersArgs,
    contenders: &[Contender],
    bar: &ProgressBar,
    task: impl Fn(u64) -> Task + Send + Sync,
) -> AccuracyResult {
    bar.set_message(name.to_owned());
    let tasks: Vec<Task> = (0..u64::from(args.rooms)).into_par_iter().map(task).collect();
    let matchers = contenders
        .iter()
        .map(|contender| {
            bar.set_message(format!("{name} {}", contender.name));
            let attempts: Vec<Attempt> = tasks
                .par_iter()
                .map(|task| {
                    let answer = contender.timed(&task.pair, &task.guess);
                    bar.inc(1);
                    Attempt::new(&answer, &task.pair.truth, task.bound)
                })
                .collect();
            let accuracy = Accuracy::of(&attempts);
            NamedAccuracy { matcher: contender.name.to_owned(), accuracy }
        })
        .collect();
    let range_std_m = args.noise.unwrap_or(RANGE_STD_M);
    AccuracyResult { name: name.to_owned(), range_std_m, matchers }
}
