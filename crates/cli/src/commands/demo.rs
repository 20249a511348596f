use crate::Outcome;
use crate::args::{DemoArgs, Global};
use crate::commands::map::where_to_look;
use crate::config::Config;
use crate::mapping::{LogSource, map_new};
use crate::result::write_result;
use crate::result_folder::{ResultFolder, SITE};
use crate::scoring::AteScore;
use crate::terminal::print;
use anyhow::{Context, Result};
use logs::write_tum;
use std::time::Instant;
use synthetic::{two_loop_building, write_carmen, write_relations};

/// Largest error that the demo calls a success, metres.
const GOOD_M: f64 = 0.1;

/// Maps a synthetic building and compares the result with the truth.
pub fn run(args: &DemoArgs, global: &Global) -> Result<Outcome> {
    let config = Config::load(&args.config)?;
    let mut folder = ResultFolder::create(&args.output)?;
    let run = two_loop_building(args.seed);
    let (mut log, mut relations) = (Vec::new(), Vec::new());
    write_carmen(&run, &mut log)?;
    write_relations(&run, 20, &mut relations)?;
    folder.write("demo.clf", &log)?;
    folder.write("demo.relations", &relations)?;

    let start = Instant::now();
    let path = args.output.join("demo.clf");
    let source = LogSource::of_text(&path, log);
    let (mapped, site) = map_new(vec![source], &folder.path(SITE), &config, global)?;
    folder.keep();
    let poses = &mapped.poses[0];
    let mut truth = Vec::new();
    let stamps = mapped.robots[0].stamps.iter().map(String::as_str);
    write_tum(&mut truth, stamps.zip(run.truth.iter().copied()))?;
    folder.write("truth.tum", &truth)?;
    let pairs: Vec<_> = run.truth.iter().copied().zip(poses.iter().copied()).collect();
    let score = AteScore::new(&pairs).context("the demo recorded no scans")?;
    let odometry: Vec<_> = run
        .observations
        .iter()
        .zip(&run.truth)
        .filter_map(|(seen, truth)| Some((*truth, seen.odom_from_base?)))
        .collect();
    let raw = AteScore::new(&odometry).context("the demo recorded no odometry")?;
    let metrics = write_result(folder, &mapped, &config, start, site)?;

    let verdict = if score.trans_rmse_m <= GOOD_M { "good" } else { "NOT GOOD" };
    let text = format!(
        "{}\n  error against the truth: {:.3} m, {:.2} deg (odometry alone: {:.2} m, {:.1} deg): {verdict}\n\
         {}\n  result folder: {}   log and truth: demo.clf, truth.tum, demo.relations",
        metrics.to_text(),
        score.trans_rmse_m,
        score.rot_rmse_deg,
        raw.trans_rmse_m,
        raw.rot_rmse_deg,
        where_to_look(&args.output, &metrics),
        args.output.display(),
    );
    let json = serde_json::json!({ "metrics": metrics, "ate": score, "odometry_ate": raw });
    print(global, &text, &json)?;
    Ok(Outcome::Fine)
}
