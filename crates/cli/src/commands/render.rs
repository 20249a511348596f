use crate::Outcome;
use crate::args::{Global, RenderArgs};
use crate::atomic::PendingFile;
use crate::commands::map::read_options;
use crate::config::Config;
use crate::drawing::occupancy;
use crate::reading::Reading;
use crate::result_folder::METRICS;
use crate::terminal::{counted, print};
use anyhow::{Context, Result, bail};
use geometry::{Pose2, wrap_angle};
use logs::g2o::{Graph, open_g2o};
use logs::{LogFile, TumPose, open_tum};
use rendering::{
    Annotations, OccupancyGrid, ScanView, Trajectory, map_png, map_svg, ros_map_pgm, ros_map_yaml,
};
use sensing::Scan;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Scans closer than this to the one drawn before add nothing, metres and radians.
const APART_M: f64 = 0.1;
const APART_RAD: f64 = 0.1;

/// Draws a map again.
pub fn run(args: &RenderArgs, global: &Global) -> Result<Outcome> {
    let format = Format::of(&args.output)?;
    let source = Source::find(args)?;
    let mut config = source.config;
    config.map.resolution_m = args.resolution.unwrap_or(config.map.resolution_m);
    let output = PendingFile::create(&args.output)?;
    let yaml_path = args.output.with_extension("yaml");
    let yaml = match format {
        Format::Pgm => Some(PendingFile::create(&yaml_path)?),
        _ => None,
    };
    let (scans, lossy) = source.read_scans(&config, args.all_scans)?;
    let views: Vec<ScanView> = scans
        .iter()
        .map(|(map_from_laser, scan)| ScanView { map_from_laser: *map_from_laser, scan })
        .collect();
    let grid = occupancy(&views, &config.map, args.crop.as_ref())?;
    output.commit(&draw(&grid, format, &source, args)?)?;
    if let Some(yaml) = yaml {
        let image = args.output.file_name().unwrap_or_default().to_string_lossy();
        yaml.commit(ros_map_yaml(&grid, &image).as_bytes())?;
    }
    let frame = grid.frame();
    let summary = serde_json::json!({
        "image": args.output, "scans": views.len(), "resolution_m": frame.resolution_m,
        "cells": [frame.width, frame.height],
    });
    let text = format!(
        "{}: {} x {} cells of {} m from {}",
        args.output.display(),
        frame.width,
        frame.height,
        frame.resolution_m,
        counted(views.len() as u64, "scan"),
    );
    print(global, &text, &summary)?;
    Ok(if lossy { Outcome::DataLost } else { Outcome::Fine })
}

/// Kinds of images.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Png,
    Pgm,
    Svg,
}

impl Format {
    fn of(path: &Path) -> Result<Self> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("png") => Ok(Format::Png),
            Some("pgm") => Ok(Format::Pgm),
            Some("svg") => Ok(Format::Svg),
            _ => bail!("{}: the name must end in .png, .pgm or .svg", path.display()),
        }
    }
}

fn draw(
    grid: &OccupancyGrid,
    format: Format,
    source: &Source,
    args: &RenderArgs,
) -> Result<Vec<u8>> {
    let poses: Vec<Pose2> = source.poses.iter().map(|p| p.pose).collect();
    let path = [Trajectory { name: &source.name, poses: &poses }];
    let bare = Annotations {
        scale_bar: false,
        legend: false,
        zoom: Some(1),
        north_arrow: args.north,
        ..Annotations::default()
    };
    let full = Annotations {
        title: Some(&source.name),
        trajectories: &path,
        north_arrow: args.north,
        ..Annotations::default()
    };
    let annotations = if args.bare { bare } else { full };
    Ok(match format {
        Format::Png => map_png(grid, &annotations)?,
        Format::Pgm => ros_map_pgm(grid),
        Format::Svg => map_svg(grid, &annotations, 0.5 * grid.frame().resolution_m).into_bytes(),
    })
}

/// A trajectory with the log it belongs to.
struct Source {
    name: String,
    poses: Vec<TumPose>,
    log: PathBuf,
    config: Config,
    /// Poses of the patches by the index of their scan.
    patches: Option<HashMap<usize, Pose2>>,
}

impl Source {
    fn find(args: &RenderArgs) -> Result<Self> {
        if args.source.is_dir() {
            return Self::of_folder(&args.source, args.log.clone());
        }
        let Some(log) = args.log.clone() else {
            bail!("a trajectory alone cannot be drawn; name its log with --log");
        };
        let name = args.source.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let poses = open_tum(&args.source)?;
        Ok(Source { name, poses, log, config: Config::default(), patches: None })
    }

    fn of_folder(folder: &Path, log: Option<PathBuf>) -> Result<Self> {
        let read = |name: &str| {
            let path = folder.join(name);
            std::fs::read_to_string(&path).with_context(|| {
                format!("{}: cannot read; is this a result folder?", path.display())
            })
        };
        let metrics: serde_json::Value = serde_json::from_str(&read(METRICS)?)
            .with_context(|| format!("{}: not JSON", folder.join(METRICS).display()))?;
        let told = metrics.pointer("/log/file").and_then(|v| v.as_str()).map(PathBuf::from);
        let Some(log) = log.or_else(|| told.clone()) else {
            bail!("{}: names no log; use --log", folder.join(METRICS).display());
        };
        let name = crate::commands::map::stem(&told.unwrap_or_else(|| log.clone()));
        let poses = open_tum(&folder.join(format!("{name}.tum")))?;
        let config = Config::parse(&read("config.toml")?, "config.toml")?;
        let patches = Some(read_patches(folder, &read("patches.csv")?)?);
        Ok(Source { name, poses, log, config, patches })
    }

    /// The scans to draw with their lasers' poses, and whether the log lost some.
    fn read_scans(&self, config: &Config, all: bool) -> Result<(Vec<(Pose2, Scan)>, bool)> {
        let file = LogFile::open(&self.log)?;
        let reading = Reading::of_file(file, &self.log, read_options(config), |record, _| record)?;
        let mut scans = Vec::new();
        let mut last: Option<Pose2> = None;
        let mut count = 0;
        for (i, record) in reading.records().enumerate() {
            count = i + 1;
            let Some(pose) = self.poses.get(i).filter(|p| p.stamp_text == record.stamp_text) else {
                bail!(
                    "{}, line {}: this scan is not in the trajectory",
                    self.log.display(),
                    record.line
                );
            };
            let map_from_base = match &self.patches {
                Some(patches) if !all => patches.get(&i).copied(),
                _ => Some(pose.pose).filter(|pose| all || is_apart(last, pose)),
            };
            let Some(map_from_base) = map_from_base else { continue };
            last = Some(map_from_base);
            let seen = record.observation;
            scans.push((map_from_base * seen.base_from_laser, seen.scan));
        }
        if count != self.poses.len() {
            bail!("{} has {count} scans, the trajectory {}", self.log.display(), self.poses.len());
        }
        Ok((scans, reading.finish()?.0.is_lossy()))
    }
}

/// The patches' poses from the graph, by the index of the scan each patch was made of.
fn read_patches(folder: &Path, csv: &str) -> Result<HashMap<usize, Pose2>> {
    let Graph::Plane(graph) = open_g2o(&folder.join("graph.g2o"))?.graph else {
        bail!("{}: not in the plane", folder.join("graph.g2o").display());
    };
    let parse = |line: &str| {
        let mut fields = line.split(',');
        let patch = fields.next()?.parse().ok()?;
        Some((fields.next()?.parse().ok()?, *graph.pose(patch)?))
    };
    csv.lines().skip(1).map(parse).collect::<Option<_>>().with_context(|| {
        format!("{}: does not fit graph.g2o", folder.join("patches.csv").display())
    })
}

/// True when a pose is far enough from the last one drawn to add something.
fn is_apart(last: Option<Pose2>, pose: &Pose2) -> bool {
    last.is_none_or(|last| {
        last.distance(pose) >= APART_M || wrap_angle(last.yaw - pose.yaw).abs() >= APART_RAD
    })
}
