use crate::Outcome;
use crate::args::{Global, RenderArgs};
use crate::atomic::PendingFile;
use crate::config::Config;
use crate::drawing::occupancy;
use crate::islands::title;
use crate::mapping::read_options;
use crate::reading::Reading;
use crate::result_folder::METRICS;
use crate::team::stem;
use crate::terminal::{counted, print};
use anyhow::{Context, Result, bail};
use geometry::{Pose2, wrap_angle};
use logs::g2o::{Graph, open_g2o};
use logs::{LogFile, TumPose, open_tum};
use rendering::{
    Annotations, OccupancyGrid, ScanView, Trajectory, map_png, map_svg, ros_map_pgm, ros_map_yaml,
};
use sensing::Scan;
use std::collections::BTreeMap;
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
    let paths: Vec<Vec<Pose2>> = source.robots.iter().map(Robot::path).collect();
    let robots = source.robots.iter().zip(&paths);
    let path: Vec<Trajectory> =
        robots.map(|(robot, poses)| Trajectory { name: &robot.name, poses }).collect();
    let heading = source.title();
    let bare = Annotations {
        scale_bar: false,
        legend: false,
        zoom: Some(1),
        north_arrow: args.north,
        ..Annotations::default()
    };
    let full = Annotations {
        title: Some(&heading),
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

/// Trajectories with the logs they belong to.
struct Source {
    robots: Vec<Robot>,
    config: Config,
    /// Index of the island to draw.
    island: usize,
}

/// A trajectory with its log.
struct Robot {
    name: String,
    poses: Vec<TumPose>,
    log: PathBuf,
    /// Patches by the index of their scan; none for a trajectory that is not of a result folder.
    patches: Option<BTreeMap<usize, PatchRow>>,
    /// Which scans are on the island to draw.
    drawn: Vec<bool>,
}

/// A patch as a result folder tells of it.
#[derive(Clone, Copy)]
struct PatchRow {
    pose: Pose2,
    /// Index of its island.
    island: usize,
}

impl Source {
    fn find(args: &RenderArgs) -> Result<Self> {
        if args.source.is_dir() {
            return Self::of_folder(&args.source, args);
        }
        let [log] = &args.log[..] else {
            bail!("a trajectory alone cannot be drawn; name its log, and only that, with --log");
        };
        let name = args.source.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let poses = open_tum(&args.source)?;
        let drawn = vec![true; poses.len()];
        let robot = Robot { name, poses, log: log.clone(), patches: None, drawn };
        Ok(Source { robots: vec![robot], config: Config::default(), island: 0 })
    }

    fn of_folder(folder: &Path, args: &RenderArgs) -> Result<Self> {
        let read = |name: &str| {
            let path = folder.join(name);
            std::fs::read_to_string(&path).with_context(|| {
                format!("{}: cannot read; is this a result folder?", path.display())
            })
        };
        let told = folder.join(METRICS).display().to_string();
        let metrics: serde_json::Value =
            serde_json::from_str(&read(METRICS)?).with_context(|| format!("{told}: not JSON"))?;
        let text = |log: &serde_json::Value, name: &str| log[name].as_str().map(str::to_owned);
        let logs = metrics["logs"].as_array().map_or(&[][..], Vec::as_slice);
        let named = logs.iter().map(|log| Some((text(log, "robot")?, text(log, "file")?)));
        let Some(named) = named.collect::<Option<Vec<_>>>().filter(|logs| !logs.is_empty()) else {
            bail!("{told}: names no logs; map them again");
        };
        let config = Config::parse(&read("config.toml")?, "config.toml")?;
        let mut patches = read_patches(folder, &read("patches.csv")?, &named)?;
        let island = args.island as usize - 1;
        let islands = patches.iter().flat_map(BTreeMap::values).map(|p| p.island + 1).max();
        if islands.is_none_or(|islands| island >= islands) {
            bail!("{}: has {} islands", folder.display(), islands.unwrap_or_default());
        }
        let mut robots = Vec::new();
        for (k, (name, file)) in named.iter().enumerate() {
            let given = args.log.iter().find(|log| named.len() == 1 || stem(log) == *name);
            let log = given.cloned().unwrap_or_else(|| PathBuf::from(file));
            let poses = open_tum(&folder.join(format!("{name}.tum")))?;
            let patches = std::mem::take(&mut patches[k]);
            robots.push(Robot::on_island(name, poses, log, patches, island));
        }
        Ok(Source { robots, config, island })
    }

    /// The names of the robots that are drawn.
    fn title(&self) -> String {
        let drawn = self.robots.iter().filter(|robot| robot.is_drawn());
        title(&drawn.map(|robot| robot.name.as_str()).collect::<Vec<_>>())
    }

    /// The scans to draw with their lasers' poses, and whether the logs lost some.
    fn read_scans(&self, config: &Config, all: bool) -> Result<(Vec<(Pose2, Scan)>, bool)> {
        let (mut scans, mut lossy) = (Vec::new(), false);
        for robot in self.robots.iter().filter(|robot| robot.is_drawn()) {
            lossy |= robot.read_scans(self.island, config, all, &mut scans)?;
        }
        Ok((scans, lossy))
    }
}

impl Robot {
    /// A scan is on the island of the last patch before it, the first ones on that of the first
    /// patch.
    fn on_island(
        name: &str,
        poses: Vec<TumPose>,
        log: PathBuf,
        patches: BTreeMap<usize, PatchRow>,
        island: usize,
    ) -> Self {
        let mut here = patches.values().next().is_some_and(|first| first.island == island);
        let is_here = |scan: usize| {
            here = patches.get(&scan).map_or(here, |patch| patch.island == island);
            here
        };
        let drawn = (0..poses.len()).map(is_here).collect();
        Robot { name: name.to_owned(), poses, log, patches: Some(patches), drawn }
    }

    fn is_drawn(&self) -> bool {
        self.drawn.contains(&true)
    }

    fn path(&self) -> Vec<Pose2> {
        let scans = self.poses.iter().zip(&self.drawn);
        scans.filter(|(_, drawn)| **drawn).map(|(scan, _)| scan.pose).collect()
    }

    /// Adds the scans to draw with their lasers' poses; true when the log lost some.
    fn read_scans(
        &self,
        island: usize,
        config: &Config,
        all: bool,
        scans: &mut Vec<(Pose2, Scan)>,
    ) -> Result<bool> {
        let file = LogFile::open(&self.log)?;
        let reading = Reading::of_file(file, &self.log, read_options(config), |record, _| record)?;
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
                Some(patches) if !all => {
                    patches.get(&i).filter(|patch| patch.island == island).map(|patch| patch.pose)
                }
                _ => Some(pose.pose).filter(|pose| self.drawn[i] && (all || is_apart(last, pose))),
            };
            let Some(map_from_base) = map_from_base else { continue };
            last = Some(map_from_base);
            let seen = record.observation;
            scans.push((map_from_base * seen.base_from_laser, seen.scan));
        }
        if count != self.poses.len() {
            bail!("{} has {count} scans, the trajectory {}", self.log.display(), self.poses.len());
        }
        Ok(reading.finish()?.0.is_lossy())
    }
}

/// Each robot's patches with their poses from the graph, by the index of the scan each was made of.
fn read_patches(
    folder: &Path,
    csv: &str,
    robots: &[(String, String)],
) -> Result<Vec<BTreeMap<usize, PatchRow>>> {
    let Graph::Plane(graph) = open_g2o(&folder.join("graph.g2o"))?.graph else {
        bail!("{}: not in the plane", folder.join("graph.g2o").display());
    };
    let mut patches = vec![BTreeMap::new(); robots.len()];
    let mut parse = |line: &str| {
        // A robot's name may hold commas.
        let (front, island) = line.rsplit_once(',')?;
        let mut fields = front.splitn(4, ',');
        let pose = *graph.pose(fields.next()?.parse().ok()?)?;
        let scan = fields.next()?.parse().ok()?;
        let name = unquoted(fields.nth(1)?);
        let robot = robots.iter().position(|(robot, _)| *robot == name)?;
        let island = island.parse::<usize>().ok()?.checked_sub(1)?;
        patches[robot].insert(scan, PatchRow { pose, island });
        Some(())
    };
    csv.lines().skip(1).map(&mut parse).collect::<Option<()>>().with_context(|| {
        format!("{}: does not fit graph.g2o", folder.join("patches.csv").display())
    })?;
    Ok(patches)
}

/// A field of a CSV file without its quotes.
fn unquoted(field: &str) -> String {
    let inner = field.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    inner.map_or_else(|| field.to_owned(), |inner| inner.replace("\"\"", "\""))
}

/// True when a pose is far enough from the last one drawn to add something.
fn is_apart(last: Option<Pose2>, pose: &Pose2) -> bool {
    last.is_none_or(|last| {
        last.distance(pose) >= APART_M || wrap_angle(last.yaw - pose.yaw).abs() >= APART_RAD
    })
}
