use crate::mapping::{MappedLog, path_length};
use crate::terminal::{counted, grouped};
use serde::Serialize;
use slam::Statistics;
use std::collections::BTreeMap;
use std::time::Duration;

/// What is told of a run, in `metrics.json` and in the report.
#[derive(Debug, Serialize)]
pub struct Metrics {
    /// Version of the program.
    pub version: &'static str,
    /// The log.
    pub log: LogMetrics,
    /// The map.
    pub map: MapMetrics,
    /// Wall-clock seconds by stage; `reading` runs beside the others, `waiting` is for the reader.
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
    /// Where it was.
    pub file: String,
    /// From the least to the greatest stamp.
    pub duration_secs: f64,
    /// Lines in it.
    pub lines: u64,
    /// Scans mapped.
    pub scans: u64,
    /// Scans told twice.
    pub duplicate_scans: u64,
    /// Stamps that jump back.
    pub stamps_back: u64,
    /// Beams without a usable reading.
    pub invalid_beams: u64,
    /// Landmarks seen, those of the table beside the log included.
    pub sightings: u64,
    /// The table of landmarks beside the log, where there is one.
    pub landmark_table: Option<String>,
    /// Messages that are not scans.
    pub skipped_messages: BTreeMap<String, u64>,
    /// Lines that could not be used.
    pub dropped_lines: u64,
    /// The first of them, with reasons.
    pub dropped: Vec<String>,
    /// Why reading stopped early, if it did.
    pub failure: Option<String>,
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
    /// Length of the path, metres.
    pub path_m: f64,
    /// Side of a cell of the drawn map, metres.
    pub resolution_m: f64,
    /// Cells of the drawn map, along x and y.
    pub cells: [usize; 2],
}

impl Metrics {
    /// Gathers a run's figures.
    pub fn new(
        file: &str,
        mapped: &MappedLog,
        frame: &rendering::GridFrame,
        rendering: Duration,
        total: Duration,
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
        tell("rendering".into(), rendering);
        tell("total".into(), total);
        Metrics {
            version: env!("CARGO_PKG_VERSION"),
            log: LogMetrics::new(file, mapped),
            map: MapMetrics::new(mapped, frame),
            times_secs: times,
            times_real_time: mapped.duration_secs / total.as_secs_f64().max(1e-9),
            threads: rayon::current_num_threads(),
            peak_memory_mib: peak_memory_mib(),
        }
    }

    /// A few lines for people.
    pub fn to_text(&self) -> String {
        let (log, map) = (&self.log, &self.map);
        let mut text = format!(
            "{}: {}, {:.0} m, {:.0} s of log\n  {} patches, {} of {} accepted\n  {:.2} s ({}x real time)",
            log.file,
            counted(log.scans, "scan"),
            map.path_m,
            log.duration_secs,
            grouped(map.counts.patches as u64),
            grouped(map.counts.closures.accepted as u64),
            counted(map.counts.closures.tried as u64, "closure"),
            self.times_secs.get("total").copied().unwrap_or_default(),
            grouped(self.times_real_time.round() as u64),
        );
        if let Some(peak) = self.peak_memory_mib {
            text.push_str(&format!(", {peak:.0} MiB"));
        }
        if log.dropped_lines > 0 || log.failure.is_some() {
            text.push_str(&format!("\n  LOST: {}", counted(log.dropped_lines, "dropped line")));
            for problem in log.dropped.iter().take(5).chain(&log.failure) {
                text.push_str(&format!("\n    {problem}"));
            }
        }
        text
    }
}

impl LogMetrics {
    fn new(file: &str, mapped: &MappedLog) -> Self {
        let report = &mapped.report;
        let table = report.landmark_table.as_ref();
        let named = |t: &logs::TableReport| {
            let file = t.file.display().to_string();
            t.dropped.iter().map(|row| format!("{file}: {row}")).collect::<Vec<_>>()
        };
        let rows = table.map(named).unwrap_or_default();
        LogMetrics {
            file: file.to_owned(),
            duration_secs: mapped.duration_secs,
            lines: report.lines,
            scans: report.scans,
            duplicate_scans: report.duplicates,
            stamps_back: report.stamps_back,
            invalid_beams: report.invalid_beams,
            sightings: report.sightings + table.map_or(0, |t| t.sightings),
            landmark_table: table.map(|t| t.file.display().to_string()),
            skipped_messages: report.skipped.clone(),
            dropped_lines: report.dropped_count + table.map_or(0, |t| t.dropped_count),
            dropped: report.dropped.iter().map(ToString::to_string).chain(rows).collect(),
            failure: report.failure.as_ref().map(ToString::to_string),
        }
    }
}

impl MapMetrics {
    fn new(mapped: &MappedLog, frame: &rendering::GridFrame) -> Self {
        let manifold = mapped.mapper.manifold();
        let mut relations = BTreeMap::new();
        for relation in manifold.active_relations() {
            *relations.entry(name_in_files(&relation.provenance)).or_default() += 1;
        }
        MapMetrics {
            counts: mapped.mapper.statistics(),
            islands: manifold.islands().len(),
            relations,
            path_m: path_length(&mapped.poses),
            resolution_m: frame.resolution_m,
            cells: [frame.width, frame.height],
        }
    }
}

/// The name a stage or provenance has in files.
fn name_in_files(value: &(impl Serialize + std::fmt::Debug)) -> String {
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
