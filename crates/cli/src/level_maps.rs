use crate::config::Config;
use crate::islands::map_file;
use crate::mapping::MappedTeam;
use crate::result::Drawn;
use crate::result_folder::ResultFolder;
use anyhow::Result;
use geometry::Pose2;
use manifold::{GroundKind, Levels, Manifold, Patch, PatchId};
use rendering::{
    Annotations, GridFrame, HitMissCounts, OccupancyGrid, ScanView, Trajectory, contact_sheet_png,
    map_png, ros_map_pgm, ros_map_yaml,
};
use sensing::Scan;
use serde::Serialize;
use slam::KnownGround;
use std::sync::Arc;

/// A level of an island as it is drawn; all levels of an island have the same frame.
pub struct LevelMap {
    /// Its number and height.
    pub title: String,
    /// Walls and free space.
    pub grid: OccupancyGrid,
    /// Its patches, those of ramps nearest in height included.
    pub patches: Vec<Pose2>,
    /// Robots' paths on it.
    pub paths: Vec<Vec<Pose2>>,
}

/// A level in the figures.
#[derive(Debug, Serialize)]
pub struct LevelMetrics {
    /// Height above the island's first patch, metres.
    pub elevation_m: f64,
    /// Patches on the floor.
    pub patches: usize,
    /// Patches of ramps, stairs and landings that are nearest to it in height.
    pub ramp_patches: usize,
}

impl LevelMetrics {
    /// The levels of an island; none where no heights are known.
    pub fn of(manifold: &Manifold, island: &[PatchId]) -> Vec<Self> {
        if island.iter().all(|id| manifold.patch(*id).elevation.is_none()) {
            return Vec::new();
        }
        let levels = manifold.levels(island);
        let metrics = |(k, &elevation_m): (usize, &f64)| {
            let count = |ground| {
                let members = levels.members.iter();
                members.filter(|m| m.level == k && m.ground == ground).count()
            };
            let elevation_m = (elevation_m * 1e3).round() / 1e3 + 0.0;
            let (patches, ramp_patches) = (count(GroundKind::Flat), count(GroundKind::Ramp));
            LevelMetrics { elevation_m, patches, ramp_patches }
        };
        levels.heights_m.iter().enumerate().map(metrics).collect()
    }

    /// Of several levels the heights, for people.
    pub fn all_to_text(levels: &[Self]) -> Option<String> {
        let height = |level: &Self| format!("{:.1}", level.elevation_m);
        let heights: Vec<String> = levels.iter().map(height).collect();
        (heights.len() > 1).then(|| format!("{} levels at {} m", levels.len(), heights.join(", ")))
    }
}

/// A scan where it was taken.
pub struct PlacedScan {
    /// The patch that it hangs on.
    pub patch: PatchId,
    /// Its laser.
    pub map_from_laser: Pose2,
    /// What it shows.
    pub scan: Arc<Scan>,
}

impl PlacedScan {
    /// As it is cast into a grid.
    pub fn view(&self) -> ScanView<'_> {
        ScanView { map_from_laser: self.map_from_laser, scan: &self.scan }
    }
}

/// A robot's path: where it was, and the patch that this hangs on.
pub type HangingPath = Vec<(PatchId, Pose2)>;

/// The scans of patches; those that are left out are not drawn.
pub fn patch_scans(manifold: &Manifold, patches: &[PatchId]) -> Vec<PlacedScan> {
    let patches = patches.iter().map(|id| manifold.patch(*id)).filter(|patch| !patch.left_out);
    let placed = |patch: &Patch| PlacedScan {
        patch: patch.id,
        map_from_laser: patch.island_from_patch * patch.base_from_laser,
        scan: Arc::clone(&patch.scan),
    };
    patches.map(placed).collect()
}

/// Scans without what they saw of the ground.
pub fn walls_of(manifold: &Manifold, scans: &[PlacedScan], config: &Config) -> Vec<PlacedScan> {
    let ground = KnownGround::new(manifold, &config.slam.elevation);
    let walls = |placed: &PlacedScan| {
        let PlacedScan { patch, map_from_laser, ref scan } = *placed;
        let patch_from_laser = manifold.patch(patch).island_from_patch.between(&map_from_laser);
        PlacedScan { scan: ground.walls_in(scan, patch, &patch_from_laser), ..*placed }
    };
    scans.iter().map(walls).collect()
}

impl LevelMap {
    /// Draws the levels of an island in a frame, the lowest first.
    pub fn of_levels(
        manifold: &Manifold,
        levels: &Levels,
        scans: &[PlacedScan],
        paths: &[HangingPath],
        frame: &GridFrame,
        config: &Config,
    ) -> Result<Vec<Self>> {
        let draw = |(k, height_m): (usize, &f64)| {
            let is_here = |patch: PatchId| levels.of(patch).is_some_and(|m| m.level == k);
            let views: Vec<ScanView> =
                scans.iter().filter(|placed| is_here(placed.patch)).map(PlacedScan::view).collect();
            let counts = HitMissCounts::cast(*frame, &views, &config.map.cast)?;
            let poses_here = |path: &HangingPath| {
                path.iter().filter(|(patch, _)| is_here(*patch)).map(|(_, pose)| *pose).collect()
            };
            let pose = |id: PatchId| manifold.patch(id).island_from_patch;
            Ok(LevelMap {
                title: title(k, *height_m),
                grid: OccupancyGrid::decide(&counts, &config.map.rule),
                patches: levels.patches(k).map(pose).collect(),
                paths: paths.iter().map(poses_here).collect(),
            })
        };
        levels.heights_m.iter().enumerate().map(draw).collect()
    }

    /// The paths with the robots' names; empty ones keep the colours apart.
    pub fn trajectories<'a>(&'a self, names: &[&'a str]) -> Vec<Trajectory<'a>> {
        names.iter().zip(&self.paths).map(|(name, poses)| Trajectory { name, poses }).collect()
    }

    /// What is drawn on the map.
    pub fn annotations<'a>(&'a self, trajectories: &'a [Trajectory]) -> Annotations<'a> {
        Annotations { title: Some(&self.title), trajectories, ..Annotations::default() }
    }
}

/// Writes the maps of an island's levels, and in place of the island's own image a sheet of all.
pub fn write_levels(
    folder: &ResultFolder,
    mapped: &MappedTeam,
    drawn: &Drawn,
    island: usize,
) -> Result<()> {
    let trajectories: Vec<Vec<Trajectory>> =
        drawn.levels.iter().map(|level| level.trajectories(&mapped.names())).collect();
    let mut sheet = Vec::new();
    for (k, (level, trajectories)) in drawn.levels.iter().zip(&trajectories).enumerate() {
        let annotations = level.annotations(trajectories);
        folder.write(&level_file(island, k, "png"), &map_png(&level.grid, &annotations)?)?;
        let pgm = level_file(island, k, "pgm");
        folder.write(&pgm, &ros_map_pgm(&level.grid))?;
        let yaml = ros_map_yaml(&level.grid, &pgm);
        folder.write(&level_file(island, k, "yaml"), yaml.as_bytes())?;
        sheet.push((&level.grid, annotations));
    }
    folder.write(&map_file(island, "png"), &contact_sheet_png(&sheet)?)
}

/// A file's name with the number of a level before its ending.
pub fn of_level(file: &str, level: usize) -> String {
    match file.rsplit_once('.') {
        Some((stem, ending)) => format!("{stem}-level-{level}.{ending}"),
        None => format!("{file}-level-{level}"),
    }
}

/// The file of a level's map: `map-level-0.png`, on the second island `map-2-level-0.png`.
fn level_file(island: usize, level: usize, ending: &str) -> String {
    of_level(&map_file(island, ending), level)
}

/// What stands on a level's map.
fn title(level: usize, height_m: f64) -> String {
    // Adding zero takes the sign from a zero.
    format!("level {level}: {:.1} m", (10.0 * height_m).round() / 10.0 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_height_is_less_than_nothing() {
        assert_eq!(title(0, -0.03), "level 0: 0.0 m");
        assert_eq!(title(1, 2.96), "level 1: 3.0 m");
    }

    #[test]
    fn every_level_has_a_file_of_its_own() {
        assert_eq!(level_file(0, 0, "png"), "map-level-0.png");
        assert_eq!(level_file(1, 2, "pgm"), "map-2-level-2.pgm");
        assert_eq!(of_level("house.pgm.png", 1), "house.pgm-level-1.png");
    }
}
