//! A scan against a local submap of six scans (about 2,000 points, 361 beams, 15 mm noise), as the
//! pipeline matches it: time of match and field update, error against the Cramer-Rao bound.
//!
//! `cargo run --release -p manifoldslam-matching --example submap_speed -- [ROOMS] [KEY=VALUE]...`
//!
//! Keys: `length`, `roughness`, `cell`, `reach`, `start`, `end`, `decay`, `range`, `bearing`,
//! `noise`.

mod common;

use common::SubmapScene;
use geometry::{LieGroup, Pose2};
use manifoldslam_matching::{
    BeamNoise, FastMatcher, FastSettings, FieldSettings, LineExtractor, LineFitSettings, LinePoint,
    Prior, SurfelField,
};
use sensing::Scan;
use std::hint::black_box;
use std::time::Instant;

/// Each match and each update is timed this often; the fastest counts.
const REPEATS: usize = 7;
/// `SlamConfig::match_correlation`: what the pipeline divides a match's information by.
const MATCH_CORRELATION: f64 = 10.0;

/// Everything that can be varied.
struct Setup {
    lines: LineFitSettings,
    beam: BeamNoise,
    field: FieldSettings,
    matcher: FastSettings,
    noise_std: f64,
    rooms: u64,
}

/// Outcome of all matches from one distance.
#[derive(Default)]
struct Outcome {
    match_us: Vec<f64>,
    failures: usize,
    /// Squared errors and bounds: along x, y (added) and yaw.
    error2: [f64; 2],
    bound2: [f64; 2],
    nees: Vec<f64>,
    iterations: u32,
    count: usize,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let setup = setup()?;
    let mut update_us = Vec::new();
    let (mut points, mut surfels) = (0, 0);
    let starts = [(0.3, 10.0f64), (0.03, 0.6)];
    let mut outcomes = starts.map(|_| Outcome::default());
    for seed in 0..setup.rooms {
        let room = Room::new(seed, &setup);
        points += room.submap.iter().map(|scan| scan.0.len()).sum::<usize>();
        surfels += room.field.surfel_count();
        update_us.push(room.time_update());
        for ((distance, degrees), outcome) in starts.iter().zip(&mut outcomes) {
            room.time_match(&setup, (*distance, degrees.to_radians()), seed, outcome);
        }
    }
    let rooms = setup.rooms as usize;
    println!("{rooms} rooms, {} points and {} surfels a submap", points / rooms, surfels / rooms);
    println!("field update, one scan: {}", quantiles(&mut update_us));
    for ((distance, degrees), outcome) in starts.iter().zip(&mut outcomes) {
        println!("from {distance} m, {degrees} deg:");
        outcome.print();
    }
    Ok(())
}

fn setup() -> Result<Setup, Box<dyn std::error::Error>> {
    let mut setup = Setup {
        lines: LineFitSettings::default(),
        beam: BeamNoise::default(),
        field: FieldSettings::default(),
        matcher: FastSettings::default(),
        noise_std: 0.015,
        rooms: 200,
    };
    for argument in std::env::args().skip(1) {
        let Some((key, value)) = argument.split_once('=') else {
            setup.rooms = argument.parse()?;
            continue;
        };
        let number: f32 = value.parse()?;
        match key {
            "length" => setup.lines.length_m = number.into(),
            "neighbours" => setup.lines.max_neighbours = number as usize,
            "roughness" => setup.field.roughness_m = number,
            "cell" => setup.field.cell_m = number,
            "reach" => setup.field.reach_m = number,
            "start" => setup.matcher.kernel_start_m = number,
            "end" => setup.matcher.kernel_end_m = number,
            "decay" => setup.matcher.kernel_decay = number,
            "range" => setup.beam.range_std_m = number,
            "bearing" => setup.beam.bearing_std_rad = number,
            "noise" => setup.noise_std = number.into(),
            _ => return Err(format!("unknown key {key}").into()),
        }
    }
    Ok(setup)
}

/// A submap in a room and a seventh scan.
struct Room {
    field: SurfelField,
    submap: Vec<(Vec<LinePoint>, Pose2)>,
    scan: Vec<LinePoint>,
    scene: SubmapScene,
}

impl Room {
    fn new(seed: u64, setup: &Setup) -> Self {
        let scene = SubmapScene::new(seed, setup.noise_std);
        let mut extractor = LineExtractor::new(setup.beam, setup.lines);
        let mut lines = |scan: &Scan| extractor.extract(scan, &Pose2::IDENTITY);
        let submap: Vec<_> = scene.submap.iter().map(|(scan, pose)| (lines(scan), *pose)).collect();
        let scan = lines(&scene.scan);
        let mut field = SurfelField::new(setup.field, (-12.0, -12.0), (12.0, 12.0));
        for (points, pose) in &submap {
            field.insert(points, pose);
        }
        Room { field, submap, scan, scene }
    }

    /// Time to add the last scan to a field of the others, microseconds.
    fn time_update(&self) -> f64 {
        let mut before = SurfelField::new(*self.field.settings(), (-12.0, -12.0), (12.0, 12.0));
        let Some(((points, pose), others)) = self.submap.split_last() else { return 0.0 };
        for (points, pose) in others {
            before.insert(points, pose);
        }
        fastest(|| before.clone(), |mut field| field.insert(points, pose))
    }

    fn time_match(
        &self,
        setup: &Setup,
        (distance, turn): (f64, f64),
        seed: u64,
        outcome: &mut Outcome,
    ) {
        let prior = Prior::guess(self.scene.guess(seed, distance, turn));
        let matcher = FastMatcher { settings: setup.matcher };
        let found = matcher.align(&self.field, &self.scan, &prior);
        let spent = fastest(|| (), |()| matcher.align(&self.field, &self.scan, &prior));
        outcome.match_us.push(spent);
        outcome.iterations += found.iterations;
        let error = self.scene.truth.between(&found.pose).log();
        if !found.status.is_usable() || error.xy().norm() > 0.1 || error.z.abs() > 0.05 {
            outcome.failures += 1;
            return;
        }
        let Some(bound) = self.scene.bound else { return };
        outcome.count += 1;
        outcome.error2[0] += error.xy().norm_squared();
        outcome.error2[1] += error.z * error.z;
        outcome.bound2[0] += bound[(0, 0)] + bound[(1, 1)];
        outcome.bound2[1] += bound[(2, 2)];
        if let Some(information) = found.covariance.try_inverse() {
            outcome.nees.push((error.transpose() * information * error).x);
        }
    }
}

/// The shortest of several runs, microseconds.
fn fastest<T, R>(prepare: impl Fn() -> T, work: impl Fn(T) -> R) -> f64 {
    (0..REPEATS)
        .map(|_| {
            let input = prepare();
            let began = Instant::now();
            black_box(work(black_box(input)));
            began.elapsed().as_secs_f64() * 1e6
        })
        .fold(f64::INFINITY, f64::min)
}

fn quantiles(values: &mut [f64]) -> String {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len().max(1) - 1) as f64) as usize];
    format!("median {:.1} us, 95 % {:.1} us", at(0.5), at(0.95))
}

impl Outcome {
    fn print(&mut self) {
        let ratio = |k: usize| (self.error2[k] / self.bound2[k]).sqrt();
        let rmse = |k: usize| (self.error2[k] / self.count.max(1) as f64).sqrt();
        self.nees.sort_by(f64::total_cmp);
        let median = self.nees.get(self.nees.len() / 2).copied().unwrap_or(f64::NAN);
        // The median of chi-squared with three degrees of freedom.
        let honest = median / 2.366;
        println!("  match {}", quantiles(&mut self.match_us));
        println!(
            "  failures {}, {:.1} iterations, RMSE {:.2} mm and {:.3} deg, {:.3} and {:.3} x the bound",
            self.failures,
            f64::from(self.iterations) / self.match_us.len().max(1) as f64,
            1e3 * rmse(0),
            rmse(1).to_degrees(),
            ratio(0),
            ratio(1),
        );
        println!(
            "  median NEES {honest:.2} x its expectation, {:.2} x with the pipeline's correlation",
            honest / MATCH_CORRELATION
        );
    }
}
