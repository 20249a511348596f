use crate::config::Config;
use crate::drawing::patch_views;
use crate::islands::map_file;
use crate::mapping::MappedTeam;
use crate::result::Drawn;
use crate::result_folder::ResultFolder;
use anyhow::Result;
use geometry::Pose2;
use manifold::{GroundKind, Levels, Manifold, PatchId};
use rendering::{
    Annotations, GridFrame, HitMissCounts, OccupancyGrid, ScanView, Trajectory, contact_sheet_png,
    map_png, ros_map_pgm, ros_map_yaml,
};
use sensing::RobotId;
use serde::Serialize;
use slam::KnownGround;

/// A level of an island as it is drawn; all levels of an island have the same frame.
pub struct LevelMap {
    /// Its number and height.
    pub title: String,
    /// Walls and free space.
    pub grid: OccupancyGrid,
    /// Its patches, those of ramps nearest in height included.
    pub patches: Vec<Pose2>,
    /// Robots' paths on it.
    paths: Vec<Vec<Pose2>>,
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
}

impl LevelMap {
    /// The levels of an island in a frame, the lowest first; none where there is only one.
    pub fn of_island(
        mapped: &MappedTeam,
        island: usize,
        frame: &GridFrame,
        config: &Config,
    ) -> Result<Vec<Self>> {
        let manifold = mapped.team.manifold();
        let levels = manifold.levels(&mapped.islands.islands[island].patches);
        if levels.heights_m.len() < 2 {
            return Ok(Vec::new());
        }
        let ground = KnownGround::new(manifold, &config.slam.elevation);
        let draw = |(k, height_m): (usize, &f64)| {
            let patches: Vec<PatchId> = levels.patches(k).collect();
            let scans: Vec<_> = patches.iter().map(|id| ground.walls_of(*id)).collect();
            let views: Vec<ScanView> = patch_views(manifold, &patches)
                .into_iter()
                .zip(&scans)
                .map(|(view, scan)| ScanView { scan, ..view })
                .collect();
            let counts = HitMissCounts::cast(*frame, &views, &config.map.cast)?;
            let pose = |id: &PatchId| manifold.patch(*id).island_from_patch;
            Ok(LevelMap {
                title: format!("level {k}: {:.1} m", height_m + 0.0),
                grid: OccupancyGrid::decide(&counts, &config.map.rule),
                patches: patches.iter().map(pose).collect(),
                paths: paths_on(mapped, &levels, k),
            })
        };
        levels.heights_m.iter().enumerate().map(draw).collect()
    }

    /// The paths with the robots' names.
    pub fn trajectories<'a>(&'a self, mapped: &'a MappedTeam) -> Vec<Trajectory<'a>> {
        let robots = mapped.robots.iter().zip(&self.paths);
        robots.map(|(robot, poses)| Trajectory { name: &robot.name, poses }).collect()
    }

    /// What is drawn on the map.
    pub fn annotations<'a>(&'a self, trajectories: &'a [Trajectory]) -> Annotations<'a> {
        Annotations { title: Some(&self.title), trajectories, ..Annotations::default() }
    }
}

/// Each robot's path on a level; empty for robots that are not on it.
fn paths_on(mapped: &MappedTeam, levels: &Levels, level: usize) -> Vec<Vec<Pose2>> {
    let path = |(k, poses): (usize, &Vec<Pose2>)| {
        let scans = mapped.team.scan_poses(RobotId(k as u16)).zip(poses);
        let here =
            scans.filter(|(scan, _)| levels.of(scan.patch).is_some_and(|m| m.level == level));
        here.map(|(_, pose)| *pose).collect()
    };
    mapped.poses.iter().enumerate().map(path).collect()
}

/// Writes the maps of an island's levels, and in place of the island's own image a sheet of all.
pub fn write_levels(
    folder: &ResultFolder,
    mapped: &MappedTeam,
    drawn: &Drawn,
    island: usize,
) -> Result<()> {
    let trajectories: Vec<Vec<Trajectory>> =
        drawn.levels.iter().map(|level| level.trajectories(mapped)).collect();
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

/// The file of a level's map: `map-level-0.png`, on the second island `map-2-level-0.png`.
fn level_file(island: usize, level: usize, ending: &str) -> String {
    map_file(island, ending).replace(&format!(".{ending}"), &format!("-level-{level}.{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_a_file_of_its_own() {
        assert_eq!(level_file(0, 0, "png"), "map-level-0.png");
        assert_eq!(level_file(1, 2, "pgm"), "map-2-level-2.pgm");
    }
}
