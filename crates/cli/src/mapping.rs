use crate::args::Global;
use crate::config::{Config, ScanConfig};
use crate::reading::Reading;
use crate::terminal::progress;
use anyhow::{Result, bail};
use geometry::{Matrix3, Pose2};
use logs::{LogRecord, ReadReport};
use manifold::{Manifold, Provenance};
use optimizer::{Edge, EdgeKind, PoseGraph};
use sensing::{Observation, Stamp, Velocimeter};
use slam::{Mapper, Preparation, PreparedObservation, Stage, StageObserver};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Scans between two looks at the progress bar.
const PROGRESS_EVERY: usize = 128;

/// A log turned into a map.
pub struct MappedLog {
    /// The pipeline with its map.
    pub mapper: Mapper,
    /// Stamp of every scan, verbatim and in the log's order.
    pub stamps: Vec<String>,
    /// Base pose of every scan in the map frame.
    pub poses: Vec<Pose2>,
    /// Index of the scan that each patch was made of.
    pub patch_scans: Vec<usize>,
    /// What the reader made of the log.
    pub report: ReadReport,
    /// From the least to the greatest stamp, seconds.
    pub duration_secs: f64,
    /// Where the time went.
    pub times: MappingTimes,
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

/// Measures the stages of a pipeline, which reads no clock itself.
#[derive(Clone, Debug, Default)]
struct StageClock {
    times: Arc<Mutex<BTreeMap<Stage, Duration>>>,
    began: Option<Instant>,
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

/// Maps a log of `size` bytes (0 where unknown) while it is being read.
pub fn map_log(
    reading: Reading<IncomingScan>,
    size: u64,
    config: &Config,
    global: &Global,
) -> Result<MappedLog> {
    let bar = progress(global, size, "mapping {wide_bar} {percent:>3} % {msg} {eta}");
    let clock = StageClock::default();
    let mut mapper = Mapper::observed(config.slam, Box::new(clock.clone()));
    let (mut stamps, mut patch_scans) = (Vec::new(), Vec::new());
    let (mut first, mut last) = (i64::MAX, i64::MIN);
    let (mut waiting, mut records) = (Duration::ZERO, reading.records());
    loop {
        let asked = Instant::now();
        let Some(record) = records.next() else { break };
        waiting += asked.elapsed();
        let patches = mapper.manifold().patches().len();
        let (stamp, stamp_text) = match record {
            IncomingScan::Read(record) => {
                let stamp = record.observation.stamp;
                mapper.step(record.observation);
                (stamp, record.stamp_text)
            }
            IncomingScan::Prepared(stamp, stamp_text, prepared) => {
                mapper.step_prepared(prepared);
                (stamp, stamp_text)
            }
        };
        first = first.min(stamp.0);
        last = last.max(stamp.0);
        patch_scans.resize(mapper.manifold().patches().len(), patch_scans.len());
        for scan in &mut patch_scans[patches..] {
            *scan = stamps.len();
        }
        stamps.push(stamp_text);
        if stamps.len() % PROGRESS_EVERY == 0 {
            bar.set_position(reading.position());
            bar.set_message(format!("{} scans", stamps.len()));
        }
    }
    drop(records);
    let (report, reading) = reading.finish()?;
    bar.set_message("global pass");
    if stamps.is_empty() {
        bail!("no scan could be read{}", first_problems(&report));
    }
    mapper.finish();
    let stages = clock.times.lock().map(|times| times.clone()).unwrap_or_default();
    let times = MappingTimes { reading, waiting, stages };
    bar.finish_and_clear();
    let poses = mapper.trajectory();
    let duration_secs = (last - first) as f64 * 1e-9;
    Ok(MappedLog { mapper, stamps, poses, patch_scans, report, duration_secs, times })
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

/// The map as a pose graph: patches and the relations that hold.
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
    if let Some(patch) = manifold.patches().first() {
        graph.set_fixed(u64::from(patch.id.0), true)?;
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
