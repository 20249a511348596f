use crate::bad_data::BadData;
use crate::islands::title;
use crate::level_maps::LevelMetrics;
use crate::mapping::{LogFacts, MappedRobot, MappedTeam, path_length};
use crate::terminal::{counted, grouped};
use manifold::Provenance;
use rendering::GridFrame;
use sensing::RobotId;
use serde::Serialize;
use slam::{Merge, MergeState, Statistics};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// What is told of a run, in `metrics.json` and in the report.
#[derive(Debug, Serialize)]
pub struct Metrics {
    /// Version of the program.
    pub version: &'static str,
    /// The logs, by the robots' names.
    pub logs: Vec<LogMetrics>,
    /// Logs that could not be mapped, with reasons.
    pub failures: Vec<String>,
    /// All maps together.
    pub map: MapMetrics,
    /// The connected maps, largest first.
    pub islands: Vec<IslandMetrics>,
    /// Islands that were joined, and those that may be but are not.
    pub merges: Vec<Merge>,
    /// Wall-clock seconds by stage; `reading` runs beside the others, `waiting` is for the reader,
    /// `writing` for the manifold file.
    pub times_secs: BTreeMap<String, f64>,
    /// Log seconds mapped in one second.
    pub times_real_time: f64,
    /// Worker threads.
    pub threads: usize,
    /// Largest resident memory, MiB; null where the system does not tell.
    pub peak_memory_mib: Option<f64>,
}

/// What was read.
#[derive(Debug, Serialize)]
pub struct LogMetrics {
    /// The robot's name: the log's, without folders and endings.
    pub robot: String,
    /// Where it was.
    pub file: String,
    /// What the reader made of it.
    #[serde(flatten)]
    pub facts: LogFacts,
    /// Scans that became patches.
    pub patches: usize,
    /// Length of the path, metres.
    pub path_m: f64,
    /// Numbers of the islands the robot's patches are on, from 1.
    pub islands: Vec<usize>,
    /// Its trajectories, each in the frame of one island.
    pub trajectories: Vec<TrajectoryFile>,
    /// What is left out of the map because the data were bad.
    pub bad_data: Vec<BadData>,
}

/// Where a robot was on an island.
#[derive(Debug, Serialize)]
pub struct TrajectoryFile {
    /// The file of the poses.
    pub file: String,
    /// Number of the island, from 1.
    pub island: usize,
    /// Scans on it.
    pub scans: usize,
}

/// A connected map.
#[derive(Debug, Serialize)]
pub struct IslandMetrics {
    /// Patches on it.
    pub patches: usize,
    /// Robots with a patch on it, by name.
    pub robots: Vec<String>,
    /// Length of all paths on it, metres.
    pub path_m: f64,
    /// Its levels, the lowest first, where some robot told its attitude.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<LevelMetrics>,
    /// Side of a cell of the drawn map, metres.
    pub resolution_m: f64,
    /// Cells of the drawn map, along x and y.
    pub cells: [usize; 2],
}

/// What was made of it.
#[derive(Debug, Serialize)]
pub struct MapMetrics {
    /// What the pipeline counted: patches, closures tried, accepted and rejected by reason, and
    /// more.
    pub counts: Statistics,
    /// Connected maps.
    pub islands: usize,
    /// Relations that hold, by provenance.
    pub relations: BTreeMap<String, usize>,
    /// Landmarks that stand still; those whose id was seen at several places count as often.
    pub landmarks: usize,
    /// Length of all paths, metres.
    pub path_m: f64,
}

/// Wall-clock time beside the mapping.
#[derive(Clone, Copy, Debug)]
pub struct Afterwards {
    /// Drawing, and writing everything but the manifold file.
    pub rendering: Duration,
    /// Waiting for the manifold file, which is written beside all else.
    pub writing: Duration,
    /// From the beginning.
    pub total: Duration,
}

impl Metrics {
    /// Gathers a run's figures; `frames` are those of the islands' drawn maps.
    pub fn new(
        mapped: &MappedTeam,
        landmarks: usize,
        frames: &[GridFrame],
        after: &Afterwards,
    ) -> Self {
        let mut times = BTreeMap::new();
        let mut tell = |name: String, time: Duration| {
            times.insert(name, (time.as_secs_f64() * 1e6).round() / 1e6);
        };
        tell("reading".into(), mapped.times.reading);
        tell("waiting".into(), mapped.times.waiting);
        for (stage, time) in &mapped.times.stages {
            tell(name_in_files(stage), *time);
        }
        tell("rendering".into(), after.rendering);
        tell("writing".into(), after.writing);
        tell("total".into(), after.total);
        let logs = mapped.robots().map(|(id, robot)| LogMetrics::new(id, robot, mapped));
        let logs: Vec<LogMetrics> = logs.collect();
        let duration_secs: f64 = logs.iter().map(|log| log.facts.duration_secs).sum();
        Metrics {
            version: env!("CARGO_PKG_VERSION"),
            map: MapMetrics::new(mapped, landmarks, &logs),
            logs,
            failures: mapped.failures.clone(),
            islands: IslandMetrics::of(mapped, frames),
            merges: mapped.islands.merges(mapped.team.manifold(), mapped.team.merges()),
            times_secs: times,
            times_real_time: duration_secs / after.total.as_secs_f64().max(1e-9),
            threads: rayon::current_num_threads(),
            peak_memory_mib: peak_memory_mib(),
        }
    }

    /// A few lines for people.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        for log in &self.logs {
            text.push_str(&log.to_text());
        }
        let has_levels = self.islands.iter().any(|island| island.levels.len() > 1);
        if self.logs.len() > 1 || self.islands.len() > 1 || has_levels || !self.merges.is_empty() {
            for (k, island) in self.islands.iter().enumerate() {
                text.push_str(&format!("  island {}: {}\n", k + 1, island.to_text()));
            }
            for merge in &self.merges {
                text.push_str(&format!("  {}\n", merge_text(merge)));
            }
        }
        let counts = &self.map.counts;
        let landmarks = match self.map.landmarks {
            0 => String::new(),
            n => format!(", {}", counted(n as u64, "landmark")),
        };
        text.push_str(&format!(
            "  {} patches{landmarks}, {} of {} accepted\n  {:.2} s ({}x real time)",
            grouped(counts.patches as u64),
            grouped(counts.closures.accepted as u64),
            counted(counts.closures.tried as u64, "closure"),
            self.times_secs.get("total").copied().unwrap_or_default(),
            grouped(self.times_real_time.round() as u64),
        ));
        if let Some(peak) = self.peak_memory_mib {
            text.push_str(&format!(", {peak:.0} MiB"));
        }
        text
    }
}

/// A merge in a line.
pub fn merge_text(merge: &Merge) -> String {
    let [one, other] = merge.robots.each_ref().map(|robots| title(robots));
    let evidence = &merge.evidence;
    let state = match merge.state {
        MergeState::Merged => "merged",
        MergeState::Provisional => "not merged, evidence too weak",
    };
    let witness = match merge.provenance {
        Provenance::Landmark => "landmark",
        Provenance::Rendezvous => "meeting",
        _ => "place",
    };
    let surfaces = match evidence.compared_m {
        0 => String::new(),
        compared_m => format!(
            "{:.1} m of {compared_m} m of surface contradicted, {} beyond what a copy could hold, ",
            f64::from(evidence.contradicted_cm) / 100.0,
            counted(evidence.beyond as u64, "square"),
        ),
    };
    format!(
        "{one} | {other}: {state}; {} agreeing, {} contradicting, {surfaces}estimated chance of being \
         wrong {:.1e}",
        counted(evidence.agreeing as u64, witness),
        evidence.contradicting,
        merge.false_bound,
    )
}

impl LogMetrics {
    fn new(id: RobotId, robot: &MappedRobot, mapped: &MappedTeam) -> Self {
        let manifold = mapped.team.manifold();
        let own = manifold.patches().iter().filter(|patch| patch.robot == id);
        let islands: BTreeSet<usize> =
            own.filter_map(|p| Some(mapped.islands.index(p.id)? + 1)).collect();
        let tracks = || mapped.tracks.iter().filter(|track| track.robot == usize::from(id.0));
        let length = |track| path_length(&mapped.poses_of(track).collect::<Vec<_>>());
        let trajectories = tracks().map(|track| TrajectoryFile {
            file: track.file.clone(),
            island: track.island + 1,
            scans: track.scans.len(),
        });
        let file = std::path::absolute(&robot.log).unwrap_or_else(|_| robot.log.clone());
        LogMetrics {
            robot: robot.name.clone(),
            file: file.display().to_string(),
            facts: robot.facts.clone(),
            patches: robot.patch_scans.len(),
            path_m: tracks().map(length).fold(0.0, |sum, length| sum + length),
            islands: islands.into_iter().collect(),
            trajectories: trajectories.collect(),
            bad_data: BadData::of(robot, mapped.team.bad_stretches(id)),
        }
    }

    fn to_text(&self) -> String {
        let mut text = format!(
            "{}: {}, {:.0} m, {:.0} s of log{}\n",
            self.file,
            counted(self.facts.scans, "scan"),
            self.path_m,
            self.facts.duration_secs,
            if self.islands.is_empty() { ", left out of the map" } else { "" },
        );
        if self.facts.is_lossy() {
            let dropped = counted(self.facts.dropped_lines, "dropped line");
            text.push_str(&format!("  LOST: {dropped}\n"));
            for problem in self.facts.dropped.iter().take(5).chain(&self.facts.failure) {
                text.push_str(&format!("    {problem}\n"));
            }
        }
        text
    }
}

impl IslandMetrics {
    fn of(mapped: &MappedTeam, frames: &[GridFrame]) -> Vec<Self> {
        let islands = mapped.islands.islands.iter().enumerate().zip(frames);
        islands
            .map(|((k, island), frame)| IslandMetrics {
                patches: island.patches.len(),
                robots: island.robots.clone(),
                path_m: mapped.paths_on(k).iter().map(|path| path_length(path)).sum(),
                levels: LevelMetrics::of(mapped.team.manifold(), &island.patches),
                resolution_m: frame.resolution_m,
                cells: [frame.width, frame.height],
            })
            .collect()
    }

    fn to_text(&self) -> String {
        let patches = grouped(self.patches as u64);
        let levels = LevelMetrics::all_to_text(&self.levels).map(|text| format!(", {text}"));
        format!(
            "{} ({patches} patches, {:.0} m{})",
            title(&self.robots),
            self.path_m,
            levels.unwrap_or_default()
        )
    }
}

impl MapMetrics {
    fn new(mapped: &MappedTeam, landmarks: usize, logs: &[LogMetrics]) -> Self {
        let mut relations = BTreeMap::new();
        for relation in mapped.team.manifold().active_relations() {
            *relations.entry(name_in_files(&relation.provenance)).or_default() += 1;
        }
        MapMetrics {
            counts: mapped.team.statistics(),
            islands: mapped.islands.islands.len(),
            relations,
            landmarks,
            path_m: logs.iter().map(|log| log.path_m).sum(),
        }
    }
}

/// The name a stage or provenance has in files.
pub fn name_in_files(value: &(impl Serialize + std::fmt::Debug)) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name,
        _ => format!("{value:?}"),
    }
}

/// The process's largest resident memory so far, from Linux's `/proc`.
fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some((kib / 102.4).round() / 10.0)
}
