//! Where `render` has its scans from.

use crate::args::RenderArgs;
use crate::config::Config;
use crate::islands::{Island, IslandList};
use crate::level_maps::{HangingPath, PlacedScan, patch_scans, walls_of};
use crate::mapping::{bad_stretches, read_options, stored_config, stored_scans};
use crate::reading::Reading;
use crate::result_folder::SITE;
use crate::terminal::counted;
use crate::tracks::is_bad;
use anyhow::{Result, bail};
use geometry::{Pose2, wrap_angle};
use logs::{LogFile, open_tum};
use manifold::{Levels, Manifold, PatchId, Robot};
use sensing::RobotId;
use slam::Leveller;
use std::path::Path;
use std::sync::Arc;
use store::Site;

/// Scans closer than this to the one drawn before add nothing, metres and radians.
const APART_M: f64 = 0.1;
const APART_RAD: f64 = 0.1;

/// What there is to draw.
pub struct Source {
    /// The robots' names.
    pub names: Vec<String>,
    /// Their paths.
    pub paths: Vec<HangingPath>,
    /// Scans with their lasers' poses.
    pub scans: Vec<PlacedScan>,
    /// The island's levels, where there are several.
    pub levels: Option<IslandLevels>,
    /// The configuration of the map.
    pub config: Config,
    /// Some of the log could not be read.
    pub lossy: bool,
}

/// Levels with what is drawn of them.
pub struct IslandLevels {
    /// The map.
    pub manifold: Manifold,
    /// Its levels.
    pub levels: Levels,
    /// The scans without what they saw of the ground.
    pub walls: Vec<PlacedScan>,
}

impl Source {
    /// What the arguments name.
    pub fn find(args: &RenderArgs) -> Result<Self> {
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
        let (mut names, mut paths, mut scans) = (Vec::new(), Vec::new(), Vec::new());
        let drawn = |robot: &&Robot| robots.iter().any(|name| **name == *robot.name);
        for robot in site.manifold.robots().iter().filter(drawn) {
            let bad = bad_stretches(&site, robot.id);
            let is_here = |(k, patch): (usize, PatchId)| {
                islands.index(patch) == Some(island) && !is_bad(&bad, k)
            };
            let tracked = &site.trajectories[usize::from(robot.id.0)];
            let path = tracked.iter().map(|scan| scan.patch).zip(site.poses(robot.id)).enumerate();
            let here = path.filter(|(k, (patch, _))| is_here((*k, *patch)));
            paths.push(here.map(|(_, hanging)| hanging).collect());
            names.push(robot.name.to_string());
            if args.all_scans {
                scans.extend(all_scans(&site, robot.id, &config, is_here));
            }
        }
        if !args.all_scans {
            scans.extend(patch_scans(&site.manifold, patches));
        }
        let levels = site.manifold.levels(patches);
        let levels = (levels.heights_m.len() > 1).then(|| IslandLevels {
            walls: walls_of(&site.manifold, &scans, &config),
            manifold: site.manifold,
            levels,
        });
        Ok(Source { names, paths, scans, levels, config, lossy: false })
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
                scans.push(PlacedScan {
                    patch: PatchId::default(),
                    map_from_laser: pose.pose * seen.base_from_laser,
                    scan: Arc::new(seen.scan),
                });
            }
        }
        if count != poses.len() {
            bail!("{} has {count} scans, the trajectory {}", log.display(), poses.len());
        }
        let paths = vec![poses.iter().map(|scan| (PatchId::default(), scan.pose)).collect()];
        let lossy = reading.finish()?.0.is_lossy();
        Ok(Source { names: vec![name], paths, scans, levels: None, config, lossy })
    }
}

/// A robot's scans, those of a leaning one put on the plan, as far as they are wanted.
fn all_scans(
    site: &Site,
    robot: RobotId,
    config: &Config,
    is_wanted: impl Fn((usize, PatchId)) -> bool,
) -> Vec<PlacedScan> {
    let mut leveller = Leveller::new(&config.slam);
    let scans = stored_scans(site, robot).into_iter().zip(site.poses(robot)).enumerate();
    let placed = |(k, (stored, pose)): (usize, (slam::StoredScan, Pose2))| {
        let mut seen = stored.observation?;
        let patch = stored.pose.patch;
        let upright = leveller.level(&mut seen);
        (upright && is_wanted((k, patch))).then(|| PlacedScan {
            patch,
            map_from_laser: pose * seen.base_from_laser,
            scan: Arc::new(seen.scan),
        })
    };
    scans.filter_map(placed).collect()
}

/// True when a pose is far enough from the last one drawn to add something.
fn is_apart(last: Option<Pose2>, pose: &Pose2) -> bool {
    last.is_none_or(|last| {
        last.distance(pose) >= APART_M || wrap_angle(last.yaw - pose.yaw).abs() >= APART_RAD
    })
}
