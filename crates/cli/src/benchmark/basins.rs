use super::contender::Contender;
use super::situations::Place;
use geometry::Pose2;
use indicatif::ProgressBar;
use matching::protocol::{SUCCESS_M, pose_error};
use rayon::prelude::*;
use rendering::RenderError;
use rendering::plot::{Axis, AxisKind, HeatSheet};

/// Distances of the guess from the truth: 0 to 1 m in steps of 0.1 m.
const DISTANCES: usize = 11;
/// Turns of the guess: -90 to 90 degrees in steps of 15.
const TURNS: usize = 13;
const DIRECTIONS: usize = 8;

/// Matches that one matcher makes at one place.
pub const TRIALS: u64 = (DISTANCES * TURNS * DIRECTIONS) as u64;

/// From which guesses every matcher finds the truth at every place.
pub fn draw(
    places: &[Place],
    contenders: &[Contender],
    bar: &ProgressBar,
) -> Result<Vec<u8>, RenderError> {
    let mut maps = Vec::new();
    for place in places {
        for contender in contenders {
            bar.set_message(format!("basins {} {}", place.name, contender.name));
            maps.push(basin(place, contender, bar));
        }
    }
    HeatSheet {
        title: "How far off may a guess be?".into(),
        notes: vec![
            "One pair of scans a place; eight directions a distance.".into(),
            "Found: within 0.1 m of the truth, a radian counted as 3 m.".into(),
        ],
        scale: "of the guesses find the truth".into(),
        columns: contenders.iter().map(|c| c.name.to_owned()).collect(),
        rows: places.iter().map(|place| place.name.clone()).collect(),
        maps,
        x: Axis::new("to the right: the guess's distance, m", AxisKind::Linear(-0.05, 1.05)),
        y: Axis::new("its turn, °", AxisKind::Linear(-97.5, 97.5)),
    }
    .to_png()
}

/// Share of directions that succeed, by turn (rows) and distance (columns).
fn basin(place: &Place, contender: &Contender, bar: &ProgressBar) -> Vec<Vec<f64>> {
    let Some(pair) = place.pairs.first() else { return Vec::new() };
    let found: Vec<bool> = (0..TURNS * DISTANCES * DIRECTIONS)
        .into_par_iter()
        .map(|k| {
            let (cell, direction) = (k / DIRECTIONS, k % DIRECTIONS);
            let turn = (15.0 * (cell / DISTANCES) as f64 - 90.0).to_radians();
            let distance = 0.1 * (cell % DISTANCES) as f64;
            let (s, c) = (direction as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
            let truth = &pair.truth;
            let guess =
                Pose2::new(truth.x + distance * c, truth.y + distance * s, truth.yaw + turn);
            let (answer, _) = contender.timed(pair, &guess);
            bar.inc(1);
            pose_error(&answer.pose, truth) < SUCCESS_M
        })
        .collect();
    let share = |cell: &[bool]| cell.iter().filter(|ok| **ok).count() as f64 / cell.len() as f64;
    found
        .chunks_exact(DISTANCES * DIRECTIONS)
        .map(|row| row.chunks_exact(DIRECTIONS).map(share).collect())
        .collect()
}
