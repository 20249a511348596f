use crate::Outcome;
use crate::args::{Global, RenderArgs};
use crate::atomic::PendingFile;
use crate::config::Config;
use crate::drawing::occupancy;
use crate::islands::{Island, IslandList, title};
use crate::mapping::{bad_stretches, read_options, stored_config};
use crate::reading::Reading;
use crate::result_folder::SITE;
use crate::terminal::{counted, print};
use crate::tracks::is_bad;
use anyhow::{Result, bail};
use geometry::{Pose2, wrap_angle};
use logs::{LogFile, open_tum};
use manifold::Robot;
use rendering::{
    Annotations, OccupancyGrid, ScanView, Trajectory, map_png, map_svg, ros_map_pgm, ros_map_yaml,
};
use sensing::Scan;
use std::path::Path;
use std::sync::Arc;
use store::TrackedScan;

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
    let views: Vec<ScanView> = source
        .scans
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
    Ok(if source.lossy { Outcome::DataLost } else { Outcome::Fine })
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
    let path: Vec<Trajectory> =
        source.paths.iter().map(|(name, poses)| Trajectory { name, poses }).collect();
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

/// What there is to draw.
struct Source {
    /// The robots' paths, by name.
    paths: Vec<(String, Vec<Pose2>)>,
    /// Scans with their lasers' poses.
    scans: Vec<(Pose2, Arc<Scan>)>,
    config: Config,
    /// Some of the log could not be read.
    lossy: bool,
}

impl Source {
    fn find(args: &RenderArgs) -> Result<Self> {
        if args.source.is_dir() {
            if !args.log.is_empty() {
                bail!("a result folder holds its scans itself; --log belongs to a trajectory");
            }
            return Self::of_site(&args.source.join(SITE), args);
        }
        match &args.log[..] {
            [] => Self::of_site(&args.source, args),
            [log] => Self::of_trajectory(&args.source, log, args.all_scans),
            _ => bail!("a trajectory is drawn with one log, its own"),
        }
    }

    /// An island of a manifold file.
    fn of_site(file: &Path, args: &RenderArgs) -> Result<Self> {
        let site = store::read(file)?.site;
        let config = stored_config(&site)?.unwrap_or_default();
        let islands = IslandList::of(&site.manifold);
        let island = args.island as usize - 1;
        let Some(Island { patches, robots }) = islands.islands.get(island) else {
            bail!("{}: has {}", file.display(), counted(islands.islands.len() as u64, "island"));
        };
        let (mut paths, mut scans) = (Vec::new(), Vec::new());
        let drawn = |robot: &&Robot| robots.iter().any(|name| **name == *robot.name);
        for robot in site.manifold.robots().iter().filter(drawn) {
            let bad = bad_stretches(&site, robot.id);
            let tracked =
                site.trajectories[usize::from(robot.id.0)].iter().zip(site.poses(robot.id));
            let is_here = |(k, (scan, _)): &(usize, (&TrackedScan, Pose2))| {
                islands.index(scan.patch) == Some(island) && !is_bad(&bad, *k)
            };
            let here: Vec<(usize, Pose2)> =
                tracked.enumerate().filter(is_here).map(|(k, (_, pose))| (k, pose)).collect();
            if args.all_scans {
                let taken = site.taken(robot.id);
                scans.extend(here.iter().filter_map(|(k, pose)| {
                    let taken = taken[*k].as_ref()?;
                    Some((*pose * taken.base_from_laser, taken.scan.clone()?))
                }));
            }
            paths.push((robot.name.to_string(), here.into_iter().map(|(_, pose)| pose).collect()));
        }
        if !args.all_scans {
            let patches = patches.iter().map(|id| site.manifold.patch(*id)).filter(|p| !p.left_out);
            scans.extend(patches.map(|patch| {
                (patch.island_from_patch * patch.base_from_laser, Arc::clone(&patch.scan))
            }));
        }
        Ok(Source { paths, scans, config, lossy: false })
    }

    /// A trajectory with its log.
    fn of_trajectory(tum: &Path, log: &Path, all: bool) -> Result<Self> {
        let name = tum.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let (poses, config) = (open_tum(tum)?, Config::default());
        let file = LogFile::open(log)?;
        let reading = Reading::of_file(file, log, read_options(&config), |record, _| record)?;
        let (mut scans, mut last, mut count) = (Vec::new(), None, 0);
        for (i, record) in reading.records().enumerate() {
            count = i + 1;
            let Some(pose) = poses.get(i).filter(|p| p.stamp_text == record.stamp_text) else {
                bail!(
                    "{}, line {}: this scan is not in the trajectory",
                    log.display(),
                    record.line
                );
            };
            if all || is_apart(last, &pose.pose) {
                last = Some(pose.pose);
                let seen = record.observation;
                scans.push((pose.pose * seen.base_from_laser, Arc::new(seen.scan)));
            }
        }
        if count != poses.len() {
            bail!("{} has {count} scans, the trajectory {}", log.display(), poses.len());
        }
        let paths = vec![(name, poses.iter().map(|scan| scan.pose).collect())];
        Ok(Source { paths, scans, config, lossy: reading.finish()?.0.is_lossy() })
    }

    /// The names of the robots that are drawn.
    fn title(&self) -> String {
        title(&self.paths.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>())
    }
}

/// True when a pose is far enough from the last one drawn to add something.
fn is_apart(last: Option<Pose2>, pose: &Pose2) -> bool {
    last.is_none_or(|last| {
        last.distance(pose) >= APART_M || wrap_angle(last.yaw - pose.yaw).abs() >= APART_RAD
    })
}
