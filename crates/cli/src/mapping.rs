use crate::config::{Config, ScanConfig};
use crate::team::LogSource;
use anyhow::{Result, bail};
use geometry::{Matrix3, Pose2};
use indicatif::ProgressBar;
use logs::{LogRecord, ReadOptions, ReadReport};
use manifold::{Change, Manifold, Provenance};
use optimizer::{Edge, EdgeKind, PoseGraph};
use sensing::{Observation, Stamp, Velocimeter};
use slam::{Event, Mapper, Preparation, PreparedObservation, Stage, StageObserver};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::AddAssign;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Scans between two looks at the progress bar.
const PROGRESS_EVERY: usize = 128;

/// A log that was mapped by itself.
pub struct MappedRobot {
    /// The robot's name: the log's, without folders and endings.
    pub name: String,
    /// The log.
    pub log: PathBuf,
    /// Stamp of every scan, verbatim and in the log's order.
    pub stamps: Vec<String>,
    /// Index of the scan that each of the robot's patches was made of.
    pub patch_scans: Vec<usize>,
    /// What the reader made of the log.
    pub report: ReadReport,
    /// From the least to the greatest stamp, seconds.
    pub duration_secs: f64,
    /// Where the time went.
    pub times: MappingTimes,
}

/// What a robot knows when its log is at its end, before it meets the others.
pub struct OwnMap {
    /// Its pipeline.
    pub mapper: Mapper,
    /// How its map came to be, but for what the mapper has not told yet.
    pub changes: Vec<Change>,
}

/// Wall-clock time spent.
#[derive(Clone, Debug, Default)]
pub struct MappingTimes {
    /// The reading thread at work, beside the mapping.
    pub reading: Duration,
    /// The mapping waiting for the reader.
    pub waiting: Duration,
    /// The stages of the mapping.
    pub stages: BTreeMap<Stage, Duration>,
}

impl AddAssign<&MappingTimes> for MappingTimes {
    fn add_assign(&mut self, other: &MappingTimes) {
        self.reading += other.reading;
        self.waiting += other.waiting;
        for (stage, time) in &other.stages {
            *self.stages.entry(*stage).or_default() += *time;
        }
    }
}

/// Measures the stages of a pipeline, which reads no clock itself.
#[derive(Clone, Debug, Default)]
pub struct StageClock {
    times: Arc<Mutex<BTreeMap<Stage, Duration>>>,
    began: Option<Instant>,
}

impl StageClock {
    /// Times so far.
    pub fn times(&self) -> BTreeMap<Stage, Duration> {
        self.times.lock().map(|times| times.clone()).unwrap_or_default()
    }
}

impl StageObserver for StageClock {
    fn begin(&mut self, _: Stage) {
        self.began = Some(Instant::now());
    }

    fn end(&mut self, stage: Stage) {
        let spent = self.began.map(|began| began.elapsed()).unwrap_or_default();
        if let Ok(mut times) = self.times.lock() {
            *times.entry(stage).or_default() += spent;
        }
    }
}

/// A scan on its way from the reader to the mapper.
pub enum IncomingScan {
    /// As read: the reader was behind.
    Read(LogRecord),
    /// Prepared for the mapper, with its stamp and the stamp's text.
    Prepared(Stamp, String, PreparedObservation),
}

/// What the reading thread does with every scan. Preparing is the same work on either thread; it is
/// done where there is time.
pub fn preparing(config: &Config) -> impl FnMut(LogRecord, bool) -> IncomingScan + Send + use<> {
    let mut preparation = Preparation::new(&config.slam);
    let mut velocimeter = Velocimeter::default();
    let ScanConfig { every_nth_beam, deskew } = config.scan;
    move |mut record, behind| {
        let Observation { stamp, odom_from_base, .. } = record.observation;
        let twist = velocimeter.observe(stamp, odom_from_base);
        if every_nth_beam > 1 {
            record.observation.scan = record.observation.scan.every(every_nth_beam);
        }
        record.observation.sweep = deskew.sweep(record.twist.or(twist));
        if behind {
            return IncomingScan::Read(record);
        }
        let stamp = record.observation.stamp;
        let prepared = preparation.prepare(record.observation);
        IncomingScan::Prepared(stamp, record.stamp_text, prepared)
    }
}

/// How logs are read under a configuration.
pub fn read_options(config: &Config) -> ReadOptions {
    ReadOptions {
        limits: config.laser,
        use_odometry: config.slam.odometry.enabled,
        ..ReadOptions::default()
    }
}

/// Maps one log by itself while it is being read, up to the closing of its own loops. `bar` counts
/// the bytes of all logs.
pub fn map_robot(
    source: LogSource,
    config: &Config,
    bar: &ProgressBar,
) -> Result<(MappedRobot, OwnMap)> {
    let (name, log) = (source.name.clone(), source.path.clone());
    let reading = source.read(config)?;
    let clock = StageClock::default();
    let mut own = OwnMap {
        mapper: Mapper::observed(config.slam, Box::new(clock.clone())),
        changes: Vec::new(),
    };
    let (mut stamps, mut patch_scans) = (Vec::new(), Vec::new());
    let (mut first, mut last) = (i64::MAX, i64::MIN);
    let (mut waiting, mut records, mut told) = (Duration::ZERO, reading.records(), 0);
    loop {
        let asked = Instant::now();
        let Some(record) = records.next() else { break };
        waiting += asked.elapsed();
        let (stamp, stamp_text) = own.step(record);
        first = first.min(stamp.0);
        last = last.max(stamp.0);
        patch_scans.resize(own.mapper.manifold().patches().len(), stamps.len());
        stamps.push(stamp_text);
        if stamps.len() % PROGRESS_EVERY == 0 {
            bar.inc(reading.position().saturating_sub(told));
            told = reading.position().max(told);
        }
    }
    drop(records);
    bar.inc(reading.position().saturating_sub(told));
    let (report, reading) = reading.finish()?;
    if stamps.is_empty() {
        bail!("no scan could be read{}", first_problems(&report));
    }
    own.mapper.conclude();
    let times = MappingTimes { reading, waiting, stages: clock.times() };
    let duration_secs = (last - first) as f64 * 1e-9;
    Ok((MappedRobot { name, log, stamps, patch_scans, report, duration_secs, times }, own))
}

impl OwnMap {
    /// Takes a scan; returns its stamp and the stamp's text.
    fn step(&mut self, record: IncomingScan) -> (Stamp, String) {
        let (stamp, text, events) = match record {
            IncomingScan::Read(record) => {
                let stamp = record.observation.stamp;
                (stamp, record.stamp_text, self.mapper.step(record.observation))
            }
            IncomingScan::Prepared(stamp, text, prepared) => {
                (stamp, text, self.mapper.step_prepared(prepared))
            }
        };
        for event in events {
            if let Event::Map(change) = event {
                self.note(change);
            }
        }
        (stamp, text)
    }

    /// Keeps a change. Poses that all of a later re-estimate replaces need not be kept.
    fn note(&mut self, change: Change) {
        if let Change::PosesReestimated(new) = &change {
            let mut before = self.changes.iter_mut().rev().filter_map(|change| match change {
                Change::PosesReestimated(old) if !old.is_empty() => Some(old),
                _ => None,
            });
            if let Some(old) = before.next() {
                let new: BTreeSet<_> = new.iter().map(|(patch, _)| patch).collect();
                if old.iter().all(|(patch, _)| new.contains(patch)) {
                    *old = Vec::new();
                }
            }
        }
        self.changes.push(change);
    }
}

/// The first things that were wrong with a log, for a message.
pub fn first_problems(report: &ReadReport) -> String {
    let mut text = String::new();
    for dropped in report.dropped.iter().take(5) {
        text.push_str(&format!("\n  {dropped}"));
    }
    if report.dropped_count > 5 {
        text.push_str(&format!("\n  and {} more dropped lines", report.dropped_count - 5));
    }
    if let Some(failure) = &report.failure {
        text.push_str(&format!("\n  {failure}"));
    }
    if text.is_empty() {
        text = format!(": none of its {} lines is a laser message", report.lines);
    }
    text
}

/// The map as a pose graph: patches and the relations that hold. Each island's first
/// patch is fixed.
pub fn pose_graph(manifold: &Manifold) -> Result<PoseGraph<Pose2, 3>> {
    let mut graph = PoseGraph::new();
    for patch in manifold.patches() {
        graph.add_node(u64::from(patch.id.0), patch.island_from_patch)?;
    }
    for relation in manifold.active_relations() {
        let covariance = relation.from_from_to.covariance;
        let information = covariance.try_inverse().unwrap_or_else(Matrix3::identity);
        let information = 0.5 * (information + information.transpose());
        let kind = match relation.provenance {
            Provenance::Sequential => EdgeKind::Sequential,
            _ => EdgeKind::Closure,
        };
        let (from, to) = (u64::from(relation.from.0), u64::from(relation.to.0));
        graph.add_edge(Edge::new(from, to, relation.from_from_to.mean, information, kind))?;
    }
    for island in manifold.islands() {
        graph.set_fixed(u64::from(island[0].0), true)?;
    }
    Ok(graph)
}

/// Length of a path, metres, without the jitter of a standing robot: steps count from 10 cm on.
pub fn path_length(poses: &[Pose2]) -> f64 {
    let mut length = 0.0;
    let Some(mut last) = poses.first() else { return length };
    for pose in poses {
        let step = last.distance(pose);
        if step >= 0.1 {
            length += step;
            last = pose;
        }
    }
    length
}
