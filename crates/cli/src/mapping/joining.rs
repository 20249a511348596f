use super::keeping::{keep_begin, keep_log, keep_result, keep_statistics};
use super::one_log::{MappedRobot, Progress, map_robot};
use super::resuming::{Interrupted, interrupted, resume};
use super::{LogFacts, LogSource, MappedTeam, MappingTimes, StageClock};
use crate::args::Global;
use crate::config::Config;
use crate::site_writer::{SiteWriter, now_unix_ns};
use crate::terminal::progress;
use anyhow::{Context, Error, Result, anyhow, bail};
use indicatif::ProgressBar;
use slam::{Mapper, Team};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::scope;
use store::{SqliteStore, Store};

/// Maps logs into a new manifold file, which is returned still open.
///
/// # Errors
/// No log could be mapped, or the file cannot be written.
pub fn map_new(
    sources: Vec<LogSource>,
    file: &Path,
    config: &Config,
    global: &Global,
) -> Result<(MappedTeam, SiteWriter)> {
    let clock = StageClock::default();
    let team = Team::observed(config.slam, Box::new(clock.clone()));
    Joining::new(team, Vec::new(), clock, SiteWriter::create(file)?).add(sources, config, global)
}

/// Maps logs onto the map of an open manifold file, which is returned still open. Logs that are in
/// the map are passed over; one that was interrupted is mapped to its end.
///
/// # Errors
/// A robot of another log has the name already; the file cannot be written.
pub fn map_onto(
    sources: Vec<LogSource>,
    store: SqliteStore,
    config: &Config,
    global: &Global,
) -> Result<(MappedTeam, SiteWriter)> {
    let clock = StageClock::default();
    let site = store.site();
    let interrupted = interrupted(site);
    let mut kept = Vec::new();
    for source in sources {
        let hash = source.content_hash()?;
        if interrupted.contains_key(hash) {
            kept.push(source);
        } else if site.logs.values().any(|log| log.content_hash == hash) {
            eprintln!("manifoldslam: {}: is in the map already", source.path.display());
        } else if site.manifold.robots().iter().any(|robot| *robot.name == *source.name) {
            bail!(
                "{}: the map has a robot of this name, with another log; rename the log, for a robot is \
                 called what its log is called",
                source.path.display()
            );
        } else {
            kept.push(source);
        }
    }
    let (team, robots) = resume(site, config.slam, Box::new(clock.clone()));
    let joining = Joining::new(team, robots, clock, SiteWriter::start(store)?);
    Joining { interrupted, ..joining }.add(kept, config, global)
}

/// What a mapping thread tells of its robot.
enum News {
    Progress(Progress),
    Mapped(Box<(MappedRobot, Mapper, Progress)>),
    Failed(Error),
}

/// A team that logs are added to, with the file that keeps it.
struct Joining {
    team: Team,
    robots: Vec<MappedRobot>,
    failures: Vec<String>,
    times: MappingTimes,
    clock: StageClock,
    writer: SiteWriter,
    /// Robots of which only a part of the log is in the map, by the log's hash.
    interrupted: BTreeMap<String, Interrupted>,
}

impl Joining {
    /// A team with the robots that it has already.
    fn new(team: Team, robots: Vec<MappedRobot>, clock: StageClock, writer: SiteWriter) -> Self {
        let (failures, times) = (Vec::new(), MappingTimes::default());
        let interrupted = BTreeMap::new();
        Joining { team, robots, failures, times, clock, writer, interrupted }
    }

    /// Adds logs, joins what belongs together and makes the map anew, while the writer keeps what
    /// is known.
    ///
    /// # Errors
    /// No log could be mapped; else what failed is told beside the map.
    fn add(
        mut self,
        sources: Vec<LogSource>,
        config: &Config,
        global: &Global,
    ) -> Result<(MappedTeam, SiteWriter)> {
        keep_begin(&self.writer, config);
        if let Err(error) = self.map(sources, config, global) {
            return Err(self.writer.close().err().unwrap_or(error));
        }
        self.team.finish();
        keep_result(&self.writer, &mut self.team, "joined and refitted");
        self.times += &MappingTimes { stages: self.clock.times(), ..MappingTimes::default() };
        Ok((MappedTeam::new(self.team, self.robots, self.times, self.failures), self.writer))
    }

    /// Maps logs one beside the other; whoever's turn it is tells what it maps while it does.
    fn map(&mut self, sources: Vec<LogSource>, config: &Config, global: &Global) -> Result<()> {
        let sizes = sources.iter().map(|s| std::fs::metadata(&s.path).map_or(0, |data| data.len()));
        let bar = progress(global, sizes.sum(), "mapping {wide_bar} {percent:>3} % {msg} {eta}");
        let (senders, receivers): (Vec<_>, Vec<_>) = sources.iter().map(|_| channel()).unzip();
        let turn = AtomicUsize::new(0);
        let threads = rayon::current_num_threads().min(sources.len());
        let jobs = Mutex::new(sources.iter().cloned().zip(senders).enumerate());
        let work = || {
            while let Some((k, (source, teller))) = next(&jobs) {
                bar.set_message(source.name.clone());
                let is_turn = || turn.load(Ordering::Relaxed) == k;
                map_and_tell(source, config, &bar, is_turn, teller);
            }
        };
        scope(|scope| {
            for _ in 0..threads {
                std::thread::Builder::new().name("mapping".into()).spawn_scoped(scope, work)?;
            }
            for (k, (source, news)) in sources.iter().zip(receivers).enumerate() {
                turn.store(k, Ordering::Relaxed);
                self.join(source, news)?;
            }
            Ok::<_, Error>(())
        })?;
        bar.finish_and_clear();
        if self.robots.is_empty() {
            bail!("{}", self.failures.join("\n"));
        }
        Ok(())
    }

    /// Takes in everything one robot tells, until its log is mapped.
    fn join(&mut self, source: &LogSource, news: Receiver<News>) -> Result<()> {
        let mut joined = None;
        for news in news {
            match news {
                News::Progress(progress) => {
                    let now = self.join_once(&mut joined, source)?;
                    self.receive(now, progress);
                }
                News::Mapped(mapped) => {
                    let (mapped, mapper, progress) = *mapped;
                    let now = self.join_once(&mut joined, source)?;
                    self.receive(now, progress);
                    let robot = now.robot;
                    self.team.join(robot, mapper);
                    keep_log(&self.writer, robot, source, &mapped.facts)?;
                    keep_statistics(&self.writer, robot, &self.team);
                    self.times += &mapped.times;
                    match self.robots.get_mut(usize::from(robot.0)) {
                        Some(before) => *before = mapped,
                        None => self.robots.push(mapped),
                    }
                    return Ok(());
                }
                News::Failed(error) if joined.is_none() => {
                    self.failures.push(format!("{error:#}"));
                    return Ok(());
                }
                News::Failed(error) => return Err(error),
            }
        }
        Err(anyhow!("{}: its mapping thread has failed", source.path.display()))
    }

    /// The robot of a log, with the number of its scans that the file has.
    fn join_once(
        &mut self,
        joined: &mut Option<Interrupted>,
        source: &LogSource,
    ) -> Result<Interrupted> {
        if let Some(joined) = *joined {
            return Ok(joined);
        }
        let known = self.interrupted.remove(source.content_hash()?);
        if let Some(Interrupted { robot, .. }) = known {
            self.team.begin_again(robot);
        }
        let now = known
            .unwrap_or_else(|| Interrupted { robot: self.team.add_robot(&source.name), scans: 0 });
        *joined = Some(now);
        keep_log(&self.writer, now.robot, source, &LogFacts::default())?;
        Ok(now)
    }

    /// Takes what a robot has mapped into the team's map and has it written.
    fn receive(&mut self, joined: Interrupted, progress: Progress) {
        let Interrupted { robot, scans: known } = joined;
        self.team.receive(robot, &progress.changes);
        let changes = self.team.take_changes();
        let (mut tracked, mut taken) = (Vec::new(), Vec::new());
        for (index, mut scan, seen) in progress.scans {
            scan.patch = self.team.patch_of(robot, scan.patch);
            tracked.push((robot, index, scan));
            if index >= known {
                taken.push((robot, index, seen));
            }
        }
        self.writer.write(move |recorder| {
            recorder.keep(taken);
            recorder.record(changes, tracked, now_unix_ns())
        });
    }
}

/// The next log that no thread has taken yet.
fn next<T>(waiting: &Mutex<impl Iterator<Item = T>>) -> Option<T> {
    // A thread that panicked while it held the lock has left the list as it was.
    waiting.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).next()
}

/// Maps a log; what it has mapped is told at once where it is its turn, else when it is done.
fn map_and_tell(
    source: LogSource,
    config: &Config,
    bar: &ProgressBar,
    is_turn: impl Fn() -> bool,
    teller: Sender<News>,
) {
    // Nobody listens any more when the run has failed; the news are then of no use.
    let tell = |news| {
        let _ = teller.send(news);
    };
    let path = source.path.display().to_string();
    let when_waiting = |waiting: &mut Progress| {
        if is_turn() && !waiting.is_empty() {
            tell(News::Progress(std::mem::take(waiting)));
        }
    };
    tell(match map_robot(source, config, bar, when_waiting).context(path) {
        Ok(mapped) => News::Mapped(Box::new(mapped)),
        Err(error) => News::Failed(error),
    });
}
