use crate::Outcome;
use crate::args::{Global, MapArgs};
use crate::config::Config;
use crate::drawing::{closure_marks, occupancy_that_fits, patch_views};
use crate::mapping::{MappedLog, map_log, pose_graph, preparing};
use crate::metrics::Metrics;
use crate::reading::Reading;
use crate::result_folder::{METRICS, ResultFolder};
use crate::terminal::print;
use anyhow::{Context, Result, bail};
use geometry::Pose2;
use logs::{LogFile, ReadOptions, write_tum};
use rendering::{Annotations, Report, Trajectory, map_png, ros_map_pgm, ros_map_yaml};
use std::collections::HashSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Maps every log into a result folder.
pub fn run(args: &MapArgs, global: &Global) -> Result<Outcome> {
    let config = Config::load(&args.config)?;
    let targets = targets(args)?;
    // Missing logs and unwritable folders show before hours of mapping, not after.
    let mut jobs = Vec::new();
    for (log, target) in args.logs.iter().zip(targets) {
        LogFile::open(log)?;
        jobs.push((log, ResultFolder::create(&target)?, target));
    }
    let (mut lossy, mut text, mut all, mut failures) =
        (false, String::new(), Vec::new(), Vec::new());
    for (log, folder, target) in jobs {
        // One bad log must not cost the others theirs.
        match map_one(log, folder, &config, global) {
            Ok((metrics, is_lossy)) => {
                lossy |= is_lossy;
                let _ = writeln!(text, "{}\n{}", metrics.to_text(), where_to_look(&target));
                all.push(metrics);
            }
            Err(error) => failures.push(format!("{error:#}")),
        }
    }
    match &all[..] {
        [] => {}
        [one] if args.logs.len() == 1 => print(global, &text, one)?,
        several => print(global, &text, &several)?,
    }
    if !failures.is_empty() {
        bail!("{}", failures.join("\n"));
    }
    Ok(if lossy { Outcome::DataLost } else { Outcome::Fine })
}

/// Maps one log; true beside the figures when some of it was lost.
fn map_one(
    log: &Path,
    folder: ResultFolder,
    config: &Config,
    global: &Global,
) -> Result<(Metrics, bool)> {
    let start = Instant::now();
    let file = LogFile::open(log)?;
    let size = file.size;
    let reading = Reading::of_file(file, log, read_options(config), preparing(config))?;
    let mapped =
        map_log(reading, size, config, global).with_context(|| log.display().to_string())?;
    let metrics = write_result(folder, &stem(log), log, &mapped, config, start)?;
    Ok((metrics, mapped.report.is_lossy()))
}

/// How logs are read under a configuration.
pub fn read_options(config: &Config) -> ReadOptions {
    ReadOptions {
        limits: config.laser,
        use_odometry: config.slam.odometry.enabled,
        ..ReadOptions::default()
    }
}

/// Where the eyes should go.
pub fn where_to_look(target: &Path) -> String {
    let at = |name: &str| target.join(name).display().to_string();
    format!("  map: {}   report: {}", at("map.png"), at("report.html"))
}

/// One folder for one log; a folder below it each for several.
fn targets(args: &MapArgs) -> Result<Vec<PathBuf>> {
    if args.logs.len() == 1 {
        return Ok(vec![args.output.clone()]);
    }
    let mut seen = HashSet::new();
    let mut targets = Vec::new();
    for log in &args.logs {
        let stem = stem(log);
        if !seen.insert(stem.clone()) {
            bail!("{}: two logs of this name; map them one by one", log.display());
        }
        targets.push(args.output.join(stem));
    }
    Ok(targets)
}

/// A log's name without folders and without the endings of logs and archives.
pub fn stem(log: &Path) -> String {
    let name = log.file_name().unwrap_or(log.as_os_str()).to_string_lossy();
    let mut stem = name.as_ref();
    for ending in [".bz2", ".gz", ".clf", ".log", ".txt", ".carmen"] {
        stem = stem.strip_suffix(ending).filter(|rest| !rest.is_empty()).unwrap_or(stem);
    }
    stem.to_owned()
}

/// Writes everything a result folder holds and gives it its name.
pub fn write_result(
    folder: ResultFolder,
    stem: &str,
    log: &Path,
    mapped: &MappedLog,
    config: &Config,
    start: Instant,
) -> Result<Metrics> {
    let manifold = mapped.mapper.manifold();
    let rendering = Instant::now();
    let views = patch_views(manifold);
    let grid = occupancy_that_fits(&views, config.map)?;
    let patches: Vec<Pose2> = manifold.patches().iter().map(|p| p.island_from_patch).collect();
    let closures = closure_marks(manifold);
    let path = [Trajectory { name: stem, poses: &mapped.poses }];
    let plain = Annotations { title: Some(stem), trajectories: &path, ..Annotations::default() };
    folder.write("map.png", &map_png(&grid, &plain)?)?;
    folder.write("map.pgm", &ros_map_pgm(&grid))?;
    folder.write("map.yaml", ros_map_yaml(&grid, "map.pgm").as_bytes())?;

    let stamps = mapped.stamps.iter().map(String::as_str);
    let mut tum = Vec::new();
    write_tum(&mut tum, stamps.zip(mapped.poses.iter().copied()))?;
    folder.write(&format!("{stem}.tum"), &tum)?;
    let mut g2o = Vec::new();
    logs::g2o::write_g2o(&mut g2o, &pose_graph(manifold)?)?;
    folder.write("graph.g2o", &g2o)?;
    folder.write("patches.csv", patches_csv(mapped).as_bytes())?;
    folder.write("config.toml", config.to_toml().as_bytes())?;
    let rendering = rendering.elapsed();

    let absolute = std::path::absolute(log).unwrap_or_else(|_| log.to_owned());
    let file = absolute.display().to_string();
    let metrics = Metrics::new(&file, mapped, grid.frame(), rendering, start.elapsed());
    let annotations = Annotations { patches: &patches, closures: &closures, ..plain };
    let mut report = Report::new(stem);
    report.map(&grid, &annotations)?;
    report.heading("Figures").values(&serde_json::to_value(&metrics)?);
    report.heading("Configuration").values(&serde_json::to_value(config)?);
    folder.write("report.html", report.to_html().as_bytes())?;
    folder.write(METRICS, &serde_json::to_vec_pretty(&metrics)?)?;
    folder.commit()?;
    Ok(metrics)
}

/// Which scan each patch was made of.
fn patches_csv(mapped: &MappedLog) -> String {
    let mut text = String::from("patch,scan,stamp\n");
    for (patch, &scan) in mapped.patch_scans.iter().enumerate() {
        let _ = writeln!(text, "{patch},{scan},{}", mapped.stamps[scan]);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_lose_the_endings_of_logs_and_archives() {
        for (log, expected) in [
            ("data/intel.clf.bz2", "intel"),
            ("a.b.log.gz", "a.b"),
            ("plain", "plain"),
            (".clf", ".clf"),
            ("x.txt", "x"),
        ] {
            assert_eq!(stem(Path::new(log)), expected);
        }
    }
}
