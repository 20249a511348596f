//! How the ManifoldSLAM thesis (2006, section 7.1) compares scan matchers: from 85 disturbed
//! guesses, by one distance between poses, in nine cells.

use geometry::{Pose2, wrap_angle};
use serde::Serialize;

/// Length that one radian counts as in [`pose_error`], metres: that of the thesis, after Minguez et
/// al. (IEEE TRO 2006).
pub const ERROR_LENGTH_M: f64 = 3.0;
/// A match nearer to the truth than this has succeeded, metres of [`pose_error`].
pub const SUCCESS_M: f64 = 0.1;
/// Cells of the thesis's tables.
pub const CELLS: usize = 9;
/// The cells' names, `metres/degrees` of disturbance.
pub const CELL_NAMES: [&str; CELLS] =
    ["0/0", ".25/0", ".5/0", "0/15", ".25/15", ".5/15", "0/30", ".25/30", ".5/30"];
/// How many of the 85 disturbances fall into each cell.
pub const CELL_WEIGHTS: [usize; CELLS] = [1, 8, 8, 2, 16, 16, 2, 16, 16];
/// Radii of disturbance, metres, and turns, degrees.
const RADII_M: [f64; 3] = [0.0, 0.25, 0.5];
const TURNS_DEG: [f64; 5] = [-30.0, -15.0, 0.0, 15.0, 30.0];

/// A disturbed initial guess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Added to the true pose's coordinates: metres in the reference frame, and radians.
    pub offset: Pose2,
    /// Its cell, an index into [`CELL_NAMES`].
    pub cell: usize,
}

impl Perturbation {
    /// The guess that it makes of the truth.
    pub fn disturb(&self, truth: &Pose2) -> Pose2 {
        let offset = &self.offset;
        Pose2::new(truth.x + offset.x, truth.y + offset.y, truth.yaw + offset.yaw)
    }
}

/// The 85 disturbances: none and eight directions at 25 and 50 cm, each with five turns.
pub fn perturbations() -> Vec<Perturbation> {
    let mut all = Vec::with_capacity(85);
    for turn in TURNS_DEG {
        for (ring, radius) in RADII_M.into_iter().enumerate() {
            let directions = if ring == 0 { 1 } else { 8 };
            for k in 0..directions {
                let (s, c) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
                let offset = Pose2::new(radius * c, radius * s, turn.to_radians());
                let row = (turn.abs() / 15.0).round() as usize;
                all.push(Perturbation { offset, cell: 3 * row + ring });
            }
        }
    }
    all
}

/// `sqrt(dx^2 + dy^2 + L^2 dyaw^2)`, metres, with [`ERROR_LENGTH_M`] as L and the shorter turn.
pub fn pose_error(a: &Pose2, b: &Pose2) -> f64 {
    let turn = ERROR_LENGTH_M * wrap_angle(a.yaw - b.yaw);
    (a.translation() - b.translation()).norm().hypot(turn)
}

/// What became of one disturbed guess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Cell of the disturbance.
    pub cell: usize,
    /// [`pose_error`] of the answer, metres.
    pub error: f64,
    /// Iterations used.
    pub iterations: u32,
    /// Did the matcher call its answer converged? A degenerate one warns of itself.
    pub converged: bool,
}

/// The trials of one cell, or of all, in figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TrialFigures {
    /// How many trials.
    pub trials: usize,
    /// Root mean square of the errors, metres.
    pub rms_m: f64,
    /// Mean error, metres.
    pub mean_m: f64,
    /// Median error, metres.
    pub median_m: f64,
    /// Share of trials within [`SUCCESS_M`].
    pub success: f64,
    /// Mean number of iterations.
    pub iterations: f64,
    /// Share of trials beyond [`SUCCESS_M`] that the matcher nevertheless called converged.
    pub misled: f64,
}

impl TrialFigures {
    /// Sums trials up; all zero without any.
    pub fn of<'a>(trials: impl IntoIterator<Item = &'a Trial>) -> Self {
        let trials: Vec<&Trial> = trials.into_iter().collect();
        if trials.is_empty() {
            return TrialFigures::default();
        }
        let count = trials.len() as f64;
        let mean = |value: &dyn Fn(&Trial) -> f64| {
            trials.iter().map(|trial| value(trial)).sum::<f64>() / count
        };
        let far = |trial: &Trial| trial.error >= SUCCESS_M;
        TrialFigures {
            trials: trials.len(),
            rms_m: mean(&|t| t.error * t.error).sqrt(),
            mean_m: mean(&|t| t.error),
            median_m: median(trials.iter().map(|t| t.error)).unwrap_or_default(),
            success: mean(&|t| f64::from(u8::from(!far(t)))),
            iterations: mean(&|t| f64::from(t.iterations)),
            misled: mean(&|t| f64::from(u8::from(far(t) && t.converged))),
        }
    }
}

/// The nine cells' figures.
pub fn cell_figures(trials: &[Trial]) -> [TrialFigures; CELLS] {
    std::array::from_fn(|cell| TrialFigures::of(trials.iter().filter(|t| t.cell == cell)))
}

/// What the thesis's tables call the mean: the root mean square over the 85 disturbances, out of
/// the cells' root mean squares. (Derived: it reproduces all 20 rows of the tables.)
pub fn overall_rms(cells: &[f64; CELLS]) -> f64 {
    let squares = cells.iter().zip(CELL_WEIGHTS).map(|(rms, weight)| rms * rms * weight as f64);
    (squares.sum::<f64>() / CELL_WEIGHTS.iter().sum::<usize>() as f64).sqrt()
}

/// The middle value, the lower of the two of an even number; `None` without any.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The base row of the thesis's tables: the errors of a matcher that returns its guess.
    #[test]
    #[allow(clippy::approx_constant)] // as printed
    fn the_guess_itself_has_the_errors_of_the_thesis_s_base_row() {
        let truth = Pose2::new(1.1, -0.4, 3.0);
        let all = perturbations();
        assert_eq!(all.len(), 85);
        let trials: Vec<Trial> = all
            .iter()
            .map(|perturbation| Trial {
                cell: perturbation.cell,
                error: pose_error(&perturbation.disturb(&truth), &truth),
                iterations: 2,
                converged: true,
            })
            .collect();
        let expected = [0.0, 0.25, 0.5, 0.785398, 0.824227, 0.931048, 1.570796, 1.590566, 1.648454];
        let cells = cell_figures(&trials);
        for (k, (cell, expected)) in cells.iter().zip(expected).enumerate() {
            assert_eq!(cell.trials, CELL_WEIGHTS[k]);
            for value in [cell.rms_m, cell.mean_m, cell.median_m] {
                assert!((value - expected).abs() < 6e-7, "{}: {value}", CELL_NAMES[k]);
            }
            assert_eq!(cell.iterations, 2.0);
        }
        let overall = overall_rms(&cells.map(|cell| cell.rms_m));
        assert!((overall - 1.175057).abs() < 6e-7, "{overall}");
        let whole = TrialFigures::of(&trials);
        assert!((whole.rms_m - overall).abs() < 1e-12);
        assert!((whole.success - 1.0 / 85.0).abs() < 1e-12);
        assert!((whole.misled - 84.0 / 85.0).abs() < 1e-12);
    }

    #[test]
    fn the_shorter_turn_counts() {
        let [a, b] = [3.1, -3.1].map(|yaw| Pose2::new(0.0, 0.0, yaw));
        let turn = std::f64::consts::TAU - 6.2;
        assert!((pose_error(&a, &b) - 3.0 * turn).abs() < 1e-12);
    }

    #[test]
    fn nothing_has_no_median() {
        assert_eq!(median([]), None);
        assert_eq!(median([3.0]), Some(3.0));
        assert_eq!(median([4.0, 1.0, 3.0, 2.0]), Some(2.0));
    }
}
