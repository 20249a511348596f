use super::accuracy::{Accuracy, Attempt};
use super::args::MatchersArgs;
use super::contender::{Contender, Pair, cloud};
use super::rooms::near;
use super::visible::visible_bound;
use geometry::{Matrix3, Pose2};
use indicatif::ProgressBar;
use matching::MatchStatus;
use matching::protocol::{CELLS, Trial, TrialFigures, median, perturbations, pose_error};
use rand::{SeedableRng, rngs::StdRng};
use rayon::prelude::*;
use serde::Serialize;
use synthetic::{FloorPlan, LaserNoise, RayCaster, Situation};

/// What the protocol gave at one place.
#[derive(Debug, Serialize)]
pub struct SituationResult {
    /// Its name.
    pub name: String,
    /// Its number in the thesis, 1 to 4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thesis: Option<usize>,
    /// Distance of the two scans, metres.
    pub distance_m: f64,
    /// Turn between them, degrees.
    pub turn_deg: f64,
    /// The matchers, as they were named.
    pub matchers: Vec<MatcherResult>,
}

/// What the protocol gave for one matcher.
#[derive(Debug, Serialize)]
pub struct MatcherResult {
    /// Its name.
    pub matcher: String,
    /// The nine cells.
    pub cells: [CellResult; CELLS],
    /// All trials together.
    pub overall: CellResult,
    /// Accuracy from a few centimetres away; none where both scans have the same noise.
    pub nearby: Option<Accuracy>,
}

/// Figures of some trials.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct CellResult {
    /// Errors and iterations.
    #[serde(flatten)]
    pub figures: TrialFigures,
    /// Median time of a match, milliseconds.
    pub median_time_ms: f64,
}

/// A trial with its time.
struct TimedTrial {
    trial: Trial,
    secs: f64,
}

/// Starts from nearby for every pair of scans.
const STARTS: u64 = 8;

/// A place with its pairs of scans, one per repeat.
pub struct Place {
    /// Its name.
    pub name: String,
    /// Its number in the thesis.
    pub thesis: Option<usize>,
    /// The pairs.
    pub pairs: Vec<Pair>,
    /// The Cramer-Rao bound; none where it does not apply.
    pub bound: Option<Matrix3<f64>>,
    /// What there is to see, `world` frame; nothing is known of real places.
    pub plan: FloorPlan,
    /// Where the reference was taken.
    pub world_from_reference: Pose2,
}

/// The noise of the situations' scans.
pub fn noise(args: &MatchersArgs) -> LaserNoise {
    match args.noise {
        None => LaserNoise::usarsim(),
        Some(std) => LaserNoise { max_range: 20.0, ..LaserNoise::gaussian(std) },
    }
}

impl Place {
    /// A situation of the thesis.
    pub fn of_situation(situation: Situation, args: &MatchersArgs) -> Self {
        let scanner = Situation::scanner(noise(args));
        let world = RayCaster::new(situation.plan());
        let (reference, scan) = situation.poses();
        let pairs = (0..u64::from(args.repeats))
            .map(|repeat| {
                let seed = args.seed.wrapping_mul(100_003).wrapping_add(repeat);
                let pair = situation.pair(&world, &scanner, seed);
                let [reference, scan] =
                    [&pair.reference, &pair.scan].map(|scan| cloud(scan, &Pose2::IDENTITY));
                Pair { reference, scan, truth: pair.truth() }
            })
            .collect();
        let bound = visible_bound(&world, &scanner, &scan, &[reference]);
        Place {
            name: situation.name().to_owned(),
            thesis: Situation::ALL.iter().position(|other| *other == situation).map(|k| k + 1),
            pairs,
            // Errors of noise that is the same on both sides cancel: nothing bounds them.
            bound: bound.filter(|_| situation != Situation::SameScan),
            plan: world.plan().clone(),
            world_from_reference: reference,
        }
    }

    /// Number of matches that one matcher makes.
    pub fn matches(&self) -> u64 {
        let nearby = self.bound.map_or(0, |_| STARTS);
        self.pairs.len() as u64 * (perturbations().len() as u64 + nearby)
    }

    /// Runs the protocol for every matcher.
    pub fn compare(&self, contenders: &[Contender], bar: &ProgressBar) -> SituationResult {
        let truth = self.pairs.first().map(|pair| pair.truth).unwrap_or_default();
        SituationResult {
            name: self.name.clone(),
            thesis: self.thesis,
            distance_m: truth.norm(),
            turn_deg: truth.yaw.to_degrees(),
            matchers: contenders.iter().map(|contender| self.try_one(contender, bar)).collect(),
        }
    }

    fn try_one(&self, contender: &Contender, bar: &ProgressBar) -> MatcherResult {
        bar.set_message(format!("{} {}", self.name, contender.name));
        let guesses = perturbations();
        let trials: Vec<TimedTrial> = (0..self.pairs.len() * guesses.len())
            .into_par_iter()
            .map(|k| {
                let (pair, guess) = (&self.pairs[k / guesses.len()], &guesses[k % guesses.len()]);
                let answer = contender.timed(pair, &guess.disturb(&pair.truth));
                bar.inc(1);
                let (found, secs) = answer;
                let trial = Trial {
                    cell: guess.cell,
                    error: pose_error(&found.pose, &pair.truth),
                    iterations: found.iterations,
                    converged: found.status == MatchStatus::Converged,
                };
                TimedTrial { trial, secs }
            })
            .collect();
        let of = |wanted: &dyn Fn(&Trial) -> bool| {
            let chosen = || trials.iter().filter(|t| wanted(&t.trial));
            CellResult {
                figures: TrialFigures::of(chosen().map(|t| &t.trial)),
                median_time_ms: 1e3 * median(chosen().map(|t| t.secs)).unwrap_or_default(),
            }
        };
        let (cells, overall) = (std::array::from_fn(|cell| of(&|t| t.cell == cell)), of(&|_| true));
        MatcherResult {
            matcher: contender.name.to_owned(),
            cells,
            overall,
            nearby: self.bound.map(|bound| self.accuracy_nearby(contender, bound, bar)),
        }
    }

    /// Every pair once more from a few centimetres away: neither far, nor from the truth itself,
    /// where a matcher that hardly moves looks good.
    fn accuracy_nearby(
        &self,
        contender: &Contender,
        bound: Matrix3<f64>,
        bar: &ProgressBar,
    ) -> Accuracy {
        let tasks: Vec<(&Pair, u64)> =
            self.pairs.iter().flat_map(|pair| (0..STARTS).map(move |k| (pair, k))).collect();
        let attempts: Vec<Attempt> = tasks
            .par_iter()
            .map(|(pair, start)| {
                let guess = near(&pair.truth, &mut StdRng::seed_from_u64(*start));
                let answer = contender.timed(pair, &guess);
                bar.inc(1);
                Attempt::new(&answer, &pair.truth, Some(bound))
            })
            .collect();
        Accuracy::of(&attempts)
    }
}
