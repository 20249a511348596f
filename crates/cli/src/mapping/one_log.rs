use super::incoming::{IncomingScan, MapperInput};
use super::{LogFacts, LogSource, MappingTimes, StageClock};
use crate::config::Config;
use anyhow::{Result, bail};
use geometry::LieGroup;
use indicatif::ProgressBar;
use manifold::Change;
use slam::{Event, Mapper};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use store::{TakenScan, TrackedScan};

/// Scans between two looks at the progress bar, and between two tellings of what was mapped.
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
    pub facts: LogFacts,
    /// Where the time went.
    pub times: MappingTimes,
}

/// What a robot has mapped since it was last told; patches have the robot's own names.
#[derive(Default)]
pub struct Progress {
    /// How its map came to be.
    pub changes: Vec<Change>,
    /// Its scans by place in the log: where they were found, and what they saw.
    pub scans: Vec<(usize, TrackedScan, TakenScan)>,
}

/// Maps one log by itself while it is being read, up to the closing of its own loops. `bar` counts
/// the bytes of all logs. `tell` is shown now and then what waits to be told and may take it; what
/// is left at the end is told by the mapper itself.
pub fn map_robot(
    source: LogSource,
    config: &Config,
    bar: &ProgressBar,
    mut tell: impl FnMut(&mut Progress),
) -> Result<(MappedRobot, Mapper, Progress)> {
    let (name, log) = (source.name.clone(), source.path.clone());
    let reading = source.read(config)?;
    let clock = StageClock::default();
    let mut mapper = Mapper::observed(config.slam, Box::new(clock.clone()));
    let mut progress = Progress::default();
    let (mut stamps, mut patch_scans) = (Vec::new(), Vec::new());
    let (mut first, mut last) = (i64::MAX, i64::MIN);
    let (mut waiting, mut records, mut told) = (Duration::ZERO, reading.records(), 0);
    loop {
        let asked = Instant::now();
        let Some(scan) = records.next() else { break };
        waiting += asked.elapsed();
        first = first.min(scan.stamp.0);
        last = last.max(scan.stamp.0);
        let text = scan.stamp_text.clone();
        progress.step(&mut mapper, scan, stamps.len());
        patch_scans.resize(mapper.manifold().patches().len(), stamps.len());
        stamps.push(text);
        if stamps.len() % PROGRESS_EVERY == 0 {
            bar.inc(reading.position().saturating_sub(told));
            told = reading.position().max(told);
            tell(&mut progress);
        }
    }
    drop(records);
    bar.inc(reading.position().saturating_sub(told));
    let (report, reading) = reading.finish()?;
    let facts = LogFacts::new(&report, last.saturating_sub(first).max(0) as f64 * 1e-9);
    if stamps.is_empty() {
        bail!("no scan could be read{}", facts.first_problems());
    }
    mapper.conclude();
    progress.take_over(mapper.take_changes());
    let times = MappingTimes { reading, waiting, stages: clock.times() };
    Ok((MappedRobot { name, log, stamps, patch_scans, facts, times }, mapper, progress))
}

impl Progress {
    /// True when nothing waits.
    pub fn is_empty(&self) -> bool {
        self.changes.is_empty() && self.scans.is_empty()
    }

    /// Has a mapper take a scan and notes what came of it.
    fn step(&mut self, mapper: &mut Mapper, scan: IncomingScan, index: usize) {
        let IncomingScan { stamp, stamp_text, odom_from_base, mut taken, input } = scan;
        let odom_from_base = odom_from_base.filter(LieGroup::is_finite);
        let events = match input {
            MapperInput::Read(observation) => mapper.step(*observation),
            MapperInput::Prepared(prepared) => mapper.step_prepared(*prepared),
        };
        let mut pose = None;
        for event in events {
            match event {
                Event::Localised(_, found) => pose = Some(found),
                Event::Map(change) => {
                    // That of a leaning robot was put on the plan.
                    if let Change::PatchAdded(patch) = &change
                        && taken.scan.as_ref() == Some(&patch.scan)
                    {
                        taken.scan = None;
                    }
                    self.note(change);
                }
            }
        }
        let Some(slam::ScanPose { patch, patch_from_base }) = pose else { return };
        taken.found = patch_from_base;
        let tracked = TrackedScan { stamp_text, stamp, patch, patch_from_base, odom_from_base };
        self.scans.push((index, tracked, taken));
    }

    fn take_over(&mut self, changes: Vec<Change>) {
        changes.into_iter().for_each(|change| self.note(change));
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
