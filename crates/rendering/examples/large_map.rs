//! Time and memory of large maps: `cargo run --release -p manifoldslam-rendering --example
//! large_map [SCANS]`. A building of 100 m x 100 m at 1 cm, and an office floor at 2.5 cm, from
//! true poses.

use geometry::{Pose2, Vector2};
use manifoldslam_rendering::{
    Annotations, CastSettings, GridFrame, HitMissCounts, OccupancyGrid, OccupancyRule, RenderError,
    ScanView, Trajectory, map_png,
};
use std::time::Instant;
use synthetic::{Drive, LaserNoise, Robot, Run, Scanner, WheelNoise};

fn main() -> Result<(), RenderError> {
    let scans = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(4000);
    let robot = |beams| Robot {
        drive: Drive::default(),
        scanner: Scanner::half_circle(beams, LaserNoise::gaussian(0.01)),
        wheels: WheelNoise::poor(),
    };
    println!("threads: {}", rayon::current_num_threads());
    draw(
        "office, 30 m x 26 m at 2.5 cm",
        &synthetic::office(1, 2, &robot(180)),
        1500,
        30.0,
        0.025,
    )?;
    draw(
        "office, 100 m x 100 m at 1 cm",
        &synthetic::office(1, 7, &robot(361)),
        scans,
        100.0,
        0.01,
    )?;
    draw(
        "hall, 100 m x 100 m at 1 cm",
        &synthetic::hall(1, 100.0, 100.0, &robot(361)),
        scans,
        100.0,
        0.01,
    )
}

fn draw(
    name: &str,
    run: &Run,
    most: usize,
    side: f64,
    resolution_m: f64,
) -> Result<(), RenderError> {
    let lasers: Vec<Pose2> =
        run.truth.iter().zip(&run.observations).map(|(t, o)| *t * o.base_from_laser).collect();
    let step = lasers.len().div_ceil(most).max(1);
    let views: Vec<ScanView> = lasers
        .iter()
        .zip(&run.observations)
        .step_by(step)
        .map(|(pose, o)| ScanView { map_from_laser: *pose, scan: &o.scan })
        .collect();
    let before = resident_mib();
    let start = Instant::now();
    let frame = GridFrame::covering(Vector2::zeros(), Vector2::repeat(side), resolution_m)?;
    let counts = HitMissCounts::cast(frame, &views, &CastSettings::default())?;
    let cast = start.elapsed();
    let grid = OccupancyGrid::decide(&counts, &OccupancyRule::default());
    let decided = start.elapsed();
    drop(counts);
    let trajectories = [Trajectory { name: "robot", poses: &run.truth }];
    let annotations =
        Annotations { title: Some(name), trajectories: &trajectories, ..Annotations::default() };
    let png = map_png(&grid, &annotations)?;
    let drawn = start.elapsed();
    println!(
        "{name}: {} scans, {} x {} cells; cast {:.3} s, decide {:.3} s, image {:.3} s, together \
         {:.3} s; PNG {:.1} MB; peak {:.0} MiB of which {before:.0} MiB were there before",
        views.len(),
        frame.width,
        frame.height,
        cast.as_secs_f64(),
        (decided - cast).as_secs_f64(),
        (drawn - decided).as_secs_f64(),
        drawn.as_secs_f64(),
        png.len() as f64 / 1e6,
        peak_mib(),
    );
    Ok(())
}

/// A field of the process's status in MiB; 0 where there is none.
fn status_mib(field: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(field)).unwrap_or_default();
    let kib = line.trim_start_matches(':').trim().trim_end_matches(" kB");
    kib.parse::<f64>().unwrap_or(0.0) / 1024.0
}

fn resident_mib() -> f64 {
    status_mib("VmRSS")
}

fn peak_mib() -> f64 {
    status_mib("VmHWM")
}
