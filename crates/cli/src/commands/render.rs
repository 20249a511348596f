mod source;

use crate::Outcome;
use crate::args::{Global, RenderArgs};
use crate::atomic::PendingFile;
use crate::config::Config;
use crate::drawing::occupancy;
use crate::islands::title;
use crate::level_maps::{LevelMap, PlacedScan, of_level};
use crate::terminal::{counted, print};
use anyhow::{Result, bail};
use geometry::Pose2;
use rendering::{
    Annotations, GridFrame, OccupancyGrid, ScanView, Trajectory, contact_sheet_png, map_png,
    map_svg, ros_map_pgm, ros_map_yaml,
};
use source::{IslandLevels, Source};
use std::path::{Path, PathBuf};

/// Draws a map again.
pub fn run(args: &RenderArgs, global: &Global) -> Result<Outcome> {
    let format = Format::of(&args.output)?;
    let source = Source::find(args)?;
    let mut config = source.config;
    config.map.resolution_m = args.resolution.unwrap_or(config.map.resolution_m);
    let output = PendingFile::create(&args.output)?;
    let views: Vec<ScanView> = source.scans.iter().map(PlacedScan::view).collect();
    let grid = occupancy(&views, &config.map, args.crop.as_ref())?;
    let frame = *grid.frame();
    let images = match &source.levels {
        Some(levels) => levels_drawn(levels, &source, &frame, &config, args)?,
        None if args.level.is_some_and(|level| level > 0) => bail!("the map has one level, 0"),
        None => vec![Image::whole(grid, &source, args)],
    };
    drop(output);
    write(&images, format, args)?;
    tell(&images, &frame, source.scans.len(), args, global)?;
    Ok(if source.lossy { Outcome::DataLost } else { Outcome::Fine })
}

/// A map to draw.
struct Image {
    file: PathBuf,
    title: String,
    grid: OccupancyGrid,
    paths: Vec<(String, Vec<Pose2>)>,
}

impl Image {
    /// All of an island.
    fn whole(grid: OccupancyGrid, source: &Source, args: &RenderArgs) -> Self {
        let poses = source.paths.iter().map(|path| path.iter().map(|(_, pose)| *pose).collect());
        let paths = source.names.iter().cloned().zip(poses).collect();
        Image { file: args.output.clone(), title: title(&source.names), grid, paths }
    }

    fn trajectories(&self) -> Vec<Trajectory<'_>> {
        self.paths.iter().map(|(name, poses)| Trajectory { name, poses }).collect()
    }

    fn annotations<'a>(&'a self, paths: &'a [Trajectory], args: &RenderArgs) -> Annotations<'a> {
        let north_arrow = args.north;
        if args.bare {
            let zoom = Some(1);
            let bare = Annotations { scale_bar: false, legend: false, ..Annotations::default() };
            return Annotations { zoom, north_arrow, ..bare };
        }
        let title = Some(&*self.title);
        Annotations { title, trajectories: paths, north_arrow, ..Annotations::default() }
    }
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

/// The levels of an island, or the one that is wanted.
fn levels_drawn(
    island: &IslandLevels,
    source: &Source,
    frame: &GridFrame,
    config: &Config,
    args: &RenderArgs,
) -> Result<Vec<Image>> {
    let IslandLevels { manifold, levels, walls } = island;
    let count = levels.heights_m.len();
    if let Some(level) = args.level.filter(|&level| level >= count) {
        bail!("there is no level {level}: the map has {count}, 0 the lowest");
    }
    let maps = LevelMap::of_levels(manifold, levels, walls, &source.paths, frame, config)?;
    let wanted =
        maps.into_iter().enumerate().filter(|(k, _)| args.level.is_none_or(|level| level == *k));
    let image = |(k, map): (usize, LevelMap)| Image {
        file: match args.level {
            Some(_) => args.output.clone(),
            None => {
                let name = args.output.file_name().unwrap_or_default().to_string_lossy();
                args.output.with_file_name(of_level(&name, k))
            }
        },
        paths: source.names.iter().cloned().zip(map.paths).collect(),
        title: map.title,
        grid: map.grid,
    };
    Ok(wanted.map(image).collect())
}

/// Writes the images; several PNGs have a sheet of all under the name that was asked for.
fn write(images: &[Image], format: Format, args: &RenderArgs) -> Result<()> {
    let trajectories: Vec<Vec<Trajectory>> = images.iter().map(Image::trajectories).collect();
    let drawn: Vec<(&OccupancyGrid, Annotations)> = images
        .iter()
        .zip(&trajectories)
        .map(|(image, paths)| (&image.grid, image.annotations(paths, args)))
        .collect();
    for (image, (grid, annotations)) in images.iter().zip(&drawn) {
        let content = match format {
            Format::Png => map_png(grid, annotations)?,
            Format::Pgm => ros_map_pgm(grid),
            Format::Svg => map_svg(grid, annotations, 0.5 * grid.frame().resolution_m).into_bytes(),
        };
        PendingFile::create(&image.file)?.commit(&content)?;
        if format == Format::Pgm {
            let name = image.file.file_name().unwrap_or_default().to_string_lossy();
            let yaml = ros_map_yaml(grid, &name);
            PendingFile::create(&image.file.with_extension("yaml"))?.commit(yaml.as_bytes())?;
        }
    }
    if format == Format::Png && images.len() > 1 {
        PendingFile::create(&args.output)?.commit(&contact_sheet_png(&drawn)?)?;
    }
    Ok(())
}

/// Says what was drawn.
fn tell(
    images: &[Image],
    frame: &GridFrame,
    scans: usize,
    args: &RenderArgs,
    global: &Global,
) -> Result<()> {
    let files: Vec<&Path> = images.iter().map(|image| image.file.as_path()).collect();
    let summary = serde_json::json!({
        "image": args.output, "images": files, "scans": scans, "resolution_m": frame.resolution_m,
        "cells": [frame.width, frame.height],
    });
    let what = match images.len() {
        1 => String::new(),
        levels => format!("{}, each ", counted(levels as u64, "level")),
    };
    let text = format!(
        "{}: {what}{} x {} cells of {} m from {}",
        args.output.display(),
        frame.width,
        frame.height,
        frame.resolution_m,
        counted(scans as u64, "scan"),
    );
    print(global, &text, &summary)
}
