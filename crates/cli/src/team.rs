use crate::args::Global;
use crate::config::Config;
use crate::islands::IslandList;
use crate::mapping::{
    IncomingScan, MappedRobot, MappingTimes, OwnMap, StageClock, map_robot, preparing, read_options,
};
use crate::reading::Reading;
use crate::terminal::progress;
use anyhow::{Context, Result, anyhow, bail};
use geometry::Pose2;
use indicatif::ProgressBar;
use logs::LogFile;
use sensing::RobotId;
use slam::Team;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A log to be mapped.
#[derive(Clone, Debug)]
pub struct LogSource {
    /// The robot's name.
    pub name: String,
    /// Where the log is, or what messages call it.
    pub path: PathBuf,
    /// Its text, where it is not read from the file.
    pub text: Option<Vec<u8>>,
}

impl LogSource {
    /// A log in a file.
    pub fn of_file(path: &Path) -> Self {
        LogSource { name: stem(path), path: path.to_owned(), text: None }
    }

    /// Begins to read it.
    pub fn read(self, config: &Config) -> Result<Reading<IncomingScan>> {
        let options = read_options(config);
        if let Some(text) = self.text {
            return Reading::of_text(text, &self.path, options, preparing(config));
        }
        let file = LogFile::open(&self.path)?;
        Reading::of_file(file, &self.path, options, preparing(config))
    }
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

/// Logs turned into one map, or as many as the evidence supports.
pub struct MappedTeam {
    /// The robots, by name; their order is that of the team's robots.
    pub robots: Vec<MappedRobot>,
    /// The map.
    pub team: Team,
    /// Base pose of every scan of every robot in the frame of the island it is on.
    pub poses: Vec<Vec<Pose2>>,
    /// The connected maps.
    pub islands: IslandList,
    /// Where the time went, all robots and the team together.
    pub times: MappingTimes,
    /// Logs that could not be mapped, with reasons.
    pub failures: Vec<String>,
}

impl MappedTeam {
    /// The team's robots with what was mapped of them.
    pub fn robots(&self) -> impl Iterator<Item = (RobotId, &MappedRobot)> {
        self.robots.iter().enumerate().map(|(k, robot)| (RobotId(k as u16), robot))
    }

    /// Each robot's path on an island; empty for robots that are not on it.
    pub fn paths_on(&self, island: usize) -> Vec<Vec<Pose2>> {
        let path = |(id, _): (RobotId, _)| {
            let scans = self.team.scan_poses(id).zip(&self.poses[usize::from(id.0)]);
            let here = scans.filter(|(scan, _)| self.islands.index(scan.patch) == island);
            here.map(|(_, pose)| *pose).collect()
        };
        self.robots().map(path).collect()
    }

    /// Some of the input could not be used.
    pub fn is_lossy(&self) -> bool {
        self.robots.iter().any(|robot| robot.report.is_lossy())
    }
}

/// Sorts logs by the names of their robots, so that the result does not depend on their order.
///
/// # Errors
/// Two logs of the same name: their results would have the same name too.
pub fn canonical(mut sources: Vec<LogSource>) -> Result<Vec<LogSource>> {
    sources.sort_by(|a, b| a.name.cmp(&b.name));
    for pair in sources.windows(2) {
        if pair[0].name == pair[1].name {
            bail!(
                "{} and {}: two logs of this name; rename one of them, for a robot is called what its \
                 log is called",
                pair[0].path.display(),
                pair[1].path.display()
            );
        }
    }
    if sources.len() > usize::from(u16::MAX) {
        bail!("{} logs are too many for one map", sources.len());
    }
    Ok(sources)
}

/// Maps logs in their canonical order and joins what belongs together. A log that fails does not
/// cost the others theirs.
///
/// # Errors
/// No log could be mapped.
pub fn map_team(sources: Vec<LogSource>, config: &Config, global: &Global) -> Result<MappedTeam> {
    let sizes = sources.iter().map(|s| std::fs::metadata(&s.path).map_or(0, |data| data.len()));
    let bar = progress(global, sizes.sum(), "mapping {wide_bar} {percent:>3} % {msg} {eta}");
    let names: Vec<PathBuf> = sources.iter().map(|source| source.path.clone()).collect();
    let results = map_all(sources, config, &bar)?;
    bar.set_message("global pass");
    let clock = StageClock::default();
    let mut team = Team::observed(config.slam, Box::new(clock.clone()));
    let (mut robots, mut failures) = (Vec::new(), Vec::new());
    let mut times = MappingTimes::default();
    for (result, path) in results.into_iter().zip(names) {
        match result.with_context(|| path.display().to_string()) {
            Ok((robot, own)) => {
                let id = team.add_robot(&robot.name);
                team.receive(id, &own.changes);
                team.join(id, own.mapper);
                times += &robot.times;
                robots.push(robot);
            }
            Err(error) => failures.push(format!("{error:#}")),
        }
    }
    if robots.is_empty() {
        bail!("{}", failures.join("\n"));
    }
    team.finish();
    bar.finish_and_clear();
    times += &MappingTimes { stages: clock.times(), ..MappingTimes::default() };
    let poses = (0..robots.len()).map(|k| team.trajectory(RobotId(k as u16))).collect();
    let islands = IslandList::of(team.manifold());
    Ok(MappedTeam { robots, team, poses, islands, times, failures })
}

type OwnResult = Result<(MappedRobot, OwnMap)>;

/// Maps every log by itself. Each thread takes the next log that nobody has taken; which one maps
/// which log changes nothing.
fn map_all(sources: Vec<LogSource>, config: &Config, bar: &ProgressBar) -> Result<Vec<OwnResult>> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done: Vec<(usize, OwnResult)> = Vec::new();
        loop {
            let k = next.fetch_add(1, Ordering::Relaxed);
            let Some(source) = sources.get(k) else { return done };
            bar.set_message(source.name.clone());
            done.push((k, map_robot(source.clone(), config, bar)));
        }
    };
    let threads = rayon::current_num_threads().min(sources.len());
    let mut all = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let mut all = Vec::new();
        for thread in threads {
            all.extend(thread.join().map_err(|_| anyhow!("a mapping thread has failed"))?);
        }
        Ok::<_, anyhow::Error>(all)
    })?;
    all.sort_by_key(|(k, _)| *k);
    Ok(all.into_iter().map(|(_, result)| result).collect())
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
