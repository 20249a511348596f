use crate::config::Config;
use crate::drawing::{closure_marks, occupancy_that_fits};
use crate::islands::{map_file, title};
use crate::landmarks::{MappedLandmark, landmark_marks, landmarks_csv, landmarks_of};
use crate::level_maps::{LevelMap, PlacedScan, patch_scans, walls_of, write_levels};
use crate::mapping::{MappedTeam, pose_graph};
use crate::metrics::{Afterwards, Metrics};
use crate::report::report;
use crate::result_folder::{CONFIG, METRICS, ResultFolder};
use crate::site_writer::SiteWriter;
use anyhow::Result;
use geometry::Pose2;
use logs::write_tum;
use rendering::{
    Annotations, ClosureMark, MarkKind, OccupancyGrid, ScanView, Trajectory, map_png, ros_map_pgm,
    ros_map_yaml,
};
use std::fmt::Write;
use std::time::{Duration, Instant};

/// An island as it is drawn.
pub struct Drawn {
    /// What stands above it.
    pub title: String,
    /// Walls and free space.
    pub grid: OccupancyGrid,
    /// Robots' paths on it; empty ones keep the colours apart.
    pub paths: Vec<Vec<Pose2>>,
    /// Its patches.
    pub patches: Vec<Pose2>,
    /// What joins them.
    pub marks: Vec<ClosureMark>,
    /// Its levels, the lowest first, where there are several.
    pub levels: Vec<LevelMap>,
}

impl Drawn {
    fn new(
        mapped: &MappedTeam,
        landmarks: &[MappedLandmark],
        island: usize,
        config: &Config,
    ) -> Result<Self> {
        let manifold = mapped.team.manifold();
        let members = &mapped.islands.islands[island];
        let scans = patch_scans(manifold, &members.patches);
        let views: Vec<ScanView> = scans.iter().map(PlacedScan::view).collect();
        let pose = |id: &manifold::PatchId| manifold.patch(*id).island_from_patch;
        let grid = occupancy_that_fits(&views, config.map)?;
        let levels = match manifold.levels(&members.patches) {
            levels if levels.heights_m.len() < 2 => Vec::new(),
            levels => {
                let walls = walls_of(manifold, &scans, config);
                let paths = mapped.hanging_paths_on(island);
                LevelMap::of_levels(manifold, &levels, &walls, &paths, grid.frame(), config)?
            }
        };
        let mut marks = closure_marks(manifold, &mapped.islands, island);
        marks.extend(landmark_marks(landmarks, island));
        Ok(Drawn {
            title: title(&members.robots),
            levels,
            grid,
            paths: mapped.paths_on(island),
            patches: members.patches.iter().map(pose).collect(),
            marks,
        })
    }

    /// The paths with the robots' names.
    pub fn trajectories<'a>(&'a self, mapped: &'a MappedTeam) -> Vec<Trajectory<'a>> {
        let robots = mapped.robots.iter().zip(&self.paths);
        robots.map(|(robot, poses)| Trajectory { name: &robot.name, poses }).collect()
    }
}

/// Writes everything a result folder holds, its figures last, and gives it its name. The manifold
/// file is closed when all else is written.
pub fn write_result(
    folder: ResultFolder,
    mapped: &MappedTeam,
    config: &Config,
    start: Instant,
    site: SiteWriter,
) -> Result<Metrics> {
    let rendering = Instant::now();
    let landmarks = landmarks_of(mapped);
    let mut drawn = Vec::new();
    for island in 0..mapped.islands.islands.len() {
        drawn.push(Drawn::new(mapped, &landmarks, island, config)?);
        match drawn[island].levels.is_empty() {
            true => write_map(&folder, mapped, &drawn[island], island)?,
            false => write_levels(&folder, mapped, &drawn[island], island)?,
        }
    }
    for track in &mapped.tracks {
        let stamps = &mapped.robots[track.robot].stamps;
        let stamps = track.scans.iter().map(|&scan| stamps[scan].as_str());
        let mut tum = Vec::new();
        write_tum(&mut tum, stamps.zip(mapped.poses_of(track)))?;
        folder.write(&track.file, &tum)?;
    }
    let mut g2o = Vec::new();
    logs::g2o::write_g2o(&mut g2o, &pose_graph(mapped.team.manifold())?)?;
    folder.write("graph.g2o", &g2o)?;
    folder.write("patches.csv", patches_csv(mapped).as_bytes())?;
    if !landmarks.is_empty() {
        folder.write("landmarks.csv", landmarks_csv(mapped, &landmarks).as_bytes())?;
    }
    folder.write(CONFIG, config.to_toml().as_bytes())?;
    let after = close(site, start, rendering.elapsed())?;
    let frames: Vec<_> = drawn.iter().map(|island| *island.grid.frame()).collect();
    let metrics = Metrics::new(mapped, landmarks.len(), &frames, &after);
    let html = report(mapped, &drawn, &metrics, config)?;
    folder.write("report.html", html.as_bytes())?;
    folder.write(METRICS, &serde_json::to_vec_pretty(&metrics)?)?;
    folder.commit()?;
    Ok(metrics)
}

/// The figures alone, where there is no result folder. Closes the manifold file.
pub fn figures(
    mapped: &MappedTeam,
    config: &Config,
    start: Instant,
    site: SiteWriter,
) -> Result<Metrics> {
    let rendering = Instant::now();
    let islands = 0..mapped.islands.islands.len();
    let landmarks = landmarks_of(mapped);
    let frame = |k| Ok(*Drawn::new(mapped, &landmarks, k, config)?.grid.frame());
    let frames: Vec<_> = islands.map(frame).collect::<Result<_>>()?;
    let after = close(site, start, rendering.elapsed())?;
    Ok(Metrics::new(mapped, landmarks.len(), &frames, &after))
}

/// Closes the manifold file, at the end of a run that began at `start`.
fn close(site: SiteWriter, start: Instant, rendering: Duration) -> Result<Afterwards> {
    let writing = Instant::now();
    site.close()?;
    Ok(Afterwards { rendering, writing: writing.elapsed(), total: start.elapsed() })
}

fn write_map(
    folder: &ResultFolder,
    mapped: &MappedTeam,
    drawn: &Drawn,
    island: usize,
) -> Result<()> {
    let trajectories = drawn.trajectories(mapped);
    // What one robot's loops are is seen in the report; what joins robots belongs on their map.
    let belongs = |m: &&ClosureMark| mapped.robots.len() > 1 || m.kind == MarkKind::Sighted;
    let marks: Vec<ClosureMark> = drawn.marks.iter().filter(belongs).copied().collect();
    let annotations = Annotations {
        title: Some(&drawn.title),
        trajectories: &trajectories,
        closures: &marks,
        ..Annotations::default()
    };
    folder.write(&map_file(island, "png"), &map_png(&drawn.grid, &annotations)?)?;
    let pgm = map_file(island, "pgm");
    folder.write(&pgm, &ros_map_pgm(&drawn.grid))?;
    folder.write(&map_file(island, "yaml"), ros_map_yaml(&drawn.grid, &pgm).as_bytes())
}

/// Which scan of which robot each patch was made of, and the number of its island; 0 for a patch
/// that is left out.
fn patches_csv(mapped: &MappedTeam) -> String {
    let mut text = String::from("patch,scan,stamp,robot,island\n");
    let mut next = vec![0; mapped.robots.len()];
    for patch in mapped.team.manifold().patches() {
        let k = usize::from(patch.robot.0);
        let robot = &mapped.robots[k];
        // A robot's patches keep their order among the team's.
        let scan = robot.patch_scans[next[k]];
        next[k] += 1;
        let island = mapped.islands.index(patch.id).map_or(0, |island| island + 1);
        let (stamp, name) = (&robot.stamps[scan], csv_field(&robot.name));
        let _ = writeln!(text, "{},{scan},{stamp},{name},{island}", patch.id.0);
    }
    text
}

/// A field of a CSV file, in quotes where it needs them (RFC 4180).
pub fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
