//! What is in a manifold file, in figures.

use crate::islands::{Island, IslandList};
use crate::level_maps::LevelMetrics;
use crate::mapping::MERGES;
use crate::metrics::merge_text;
use crate::terminal::{counted, grouped};
use manifold::{Manifold, Provenance, Relation, RelationState, Retraction};
use sensing::LandmarkKind;
use serde::Serialize;
use slam::Merge;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use store::{RobotLog, SiteFile, StepSummary, provenance_name};

/// Last steps that are told.
const LAST_STEPS: usize = 5;
/// Longer values of the metadata (a configuration) are shown in JSON only.
const SHOWN: usize = 60;

/// What a file holds.
#[derive(Serialize)]
pub struct SiteInfo {
    file: String,
    bytes: u64,
    schema_version: i64,
    /// The program that first wrote each schema version into the file.
    versions: BTreeMap<i64, String>,
    changes: u64,
    steps: usize,
    metadata: BTreeMap<String, String>,
    robots: Vec<RobotInfo>,
    islands: Vec<IslandInfo>,
    /// Those that the last run made or considered.
    merges: Vec<Merge>,
    /// By provenance.
    relations: BTreeMap<&'static str, RelationCounts>,
    provisional: Vec<RelationInfo>,
    ways: usize,
    sightings: BTreeMap<&'static str, usize>,
    last_steps: Vec<StepInfo>,
    /// What joins patches, where it is asked for.
    pub listed: Option<Vec<RelationInfo>>,
    /// What `--verify` found.
    pub findings: Option<Vec<String>>,
}

#[derive(Serialize)]
struct RobotInfo {
    robot: u16,
    name: String,
    patches: usize,
    left_out: usize,
    scans: usize,
    log: Option<LogInfo>,
}

#[derive(Serialize)]
struct LogInfo {
    name: String,
    file: String,
    content_hash: String,
    joined: String,
    reader_report: serde_json::Value,
}

#[derive(Serialize)]
struct IslandInfo {
    /// From 1, the largest first, as [`IslandList`] has them.
    island: usize,
    patches: usize,
    robots: Vec<String>,
    levels: Vec<LevelMetrics>,
}

#[derive(Default, Serialize)]
struct RelationCounts {
    active: usize,
    provisional: usize,
    retracted: usize,
}

#[derive(Serialize)]
pub struct RelationInfo {
    relation: u32,
    from_patch: u32,
    to_patch: u32,
    robots: [String; 2],
    provenance: &'static str,
    state: RelationState,
}

impl RelationInfo {
    fn new(map: &Manifold, r: &Relation) -> Self {
        let robot = |patch| map.robots()[usize::from(map.patch(patch).robot.0)].name.to_string();
        RelationInfo {
            relation: r.id.0,
            from_patch: r.from.0,
            to_patch: r.to.0,
            robots: [robot(r.from), robot(r.to)],
            provenance: provenance_name(r.provenance),
            state: r.state,
        }
    }

    /// What joins patches beside the robots' own ways.
    pub fn all(map: &Manifold) -> Vec<Self> {
        let relations = map.relations().iter().filter(|r| r.provenance != Provenance::Sequential);
        relations.map(|r| RelationInfo::new(map, r)).collect()
    }

    fn to_text(&self) -> String {
        let (from, to) = (self.from_patch, self.to_patch);
        let [one, other] = &self.robots;
        let state = match self.state {
            RelationState::Active => "active",
            RelationState::Provisional => "provisional",
            RelationState::Retracted(Retraction::Contradicted) => "retracted: contradicted",
            RelationState::Retracted(Retraction::ByUser) => "retracted by the user",
            RelationState::Retracted(Retraction::BadData) => "retracted: bad data",
        };
        format!(
            "{} {}, {state}: patches {from} of {one} and {to} of {other}",
            self.provenance, self.relation
        )
    }
}

#[derive(Serialize)]
struct StepInfo {
    step: u64,
    time: String,
    note: String,
    changes: u64,
    scans: u64,
}

impl SiteInfo {
    /// Counts what a file holds.
    pub fn new(file: &Path, bytes: u64, read: &SiteFile) -> Self {
        let (site, map) = (&read.site, &read.site.manifold);
        let versions: BTreeMap<i64, String> = read.versions.iter().cloned().collect();
        let provisional = map.relations().iter().filter(|r| r.state == RelationState::Provisional);
        let islands = IslandList::of(map);
        let mut sightings = BTreeMap::new();
        for seen in map.sightings() {
            *sightings.entry(kind_name(seen.sighting.kind)).or_default() += 1;
        }
        SiteInfo {
            file: file.display().to_string(),
            bytes,
            schema_version: versions.keys().next_back().copied().unwrap_or_default(),
            versions,
            changes: read.changes,
            steps: site.steps.len(),
            metadata: site.metadata.clone(),
            robots: robots(read),
            islands: IslandInfo::all(map, &islands),
            merges: islands.merges(map, &merges(&site.metadata)),
            relations: relation_counts(map),
            provisional: provisional.map(|r| RelationInfo::new(map, r)).collect(),
            ways: map.ways().len(),
            sightings,
            last_steps: site.steps.iter().rev().take(LAST_STEPS).rev().map(StepInfo::new).collect(),
            listed: None,
            findings: None,
        }
    }

    /// For people.
    pub fn to_text(&self) -> String {
        let mut text = format!(
            "{}: {} bytes, schema version {}, {} in {}",
            self.file,
            grouped(self.bytes),
            self.schema_version,
            counted(self.changes, "change"),
            counted(self.steps as u64, "step"),
        );
        let mut line = |what: String| {
            let _ = write!(text, "\n  {what}");
        };
        // Longer ones are for programs.
        let short = |value: &String| value.len() <= SHOWN && !value.contains(['\n', '[', '{']);
        for (key, value) in self.metadata.iter().filter(|(_, value)| short(value)) {
            line(format!("{key}: {value}"));
        }
        self.robots.iter().for_each(|robot| line(robot.to_text()));
        self.islands.iter().for_each(|island| line(island.to_text()));
        for merge in &self.merges {
            line(merge_text(merge));
        }
        for (provenance, counts) in &self.relations {
            line(format!(
                "relations, {provenance}: {} active, {} provisional, {} retracted",
                counts.active, counts.provisional, counts.retracted
            ));
        }
        for relation in self.listed.as_ref().unwrap_or(&self.provisional) {
            line(relation.to_text());
        }
        for (kind, count) in &self.sightings {
            line(format!("seen: {kind}, {}", counted(*count as u64, "time")));
        }
        for step in &self.last_steps {
            let (changes, scans) = (counted(step.changes, "change"), counted(step.scans, "scan"));
            line(format!("step {}, {}: {}: {changes}, {scans}", step.step, step.time, step.note));
        }
        match &self.findings {
            Some(findings) if findings.is_empty() => {
                line("verified: the journal tells the same map".into())
            }
            _ => {}
        }
        text
    }
}

fn merges(metadata: &BTreeMap<String, String>) -> Vec<Merge> {
    metadata.get(MERGES).and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}

fn robots(read: &SiteFile) -> Vec<RobotInfo> {
    let map = &read.site.manifold;
    let info = |robot: &manifold::Robot| {
        let own = || map.patches().iter().filter(|patch| patch.robot == robot.id);
        RobotInfo {
            robot: robot.id.0,
            name: robot.name.to_string(),
            patches: own().count(),
            left_out: own().filter(|patch| patch.left_out).count(),
            scans: read.site.trajectories.get(usize::from(robot.id.0)).map_or(0, Vec::len),
            log: read.site.logs.get(&robot.id).map(LogInfo::new),
        }
    };
    map.robots().iter().map(info).collect()
}

impl LogInfo {
    fn new(log: &RobotLog) -> Self {
        LogInfo {
            name: log.name.clone(),
            file: log.file.clone(),
            content_hash: log.content_hash.clone(),
            joined: utc(log.joined_unix_ns),
            // What is no JSON is shown as text.
            reader_report: serde_json::from_str(&log.reader_report)
                .unwrap_or_else(|_| log.reader_report.clone().into()),
        }
    }
}

impl RobotInfo {
    fn to_text(&self) -> String {
        let mut text = format!(
            "robot {} ({}): {}, {}",
            self.robot,
            self.name,
            patches(self.patches),
            counted(self.scans as u64, "scan")
        );
        if self.left_out > 0 {
            let _ = write!(text, ", {} left out", self.left_out);
        }
        if let Some(log) = &self.log {
            let _ = write!(text, "; log {}, joined {}", log.file, log.joined);
        }
        text
    }
}

impl IslandInfo {
    fn all(map: &Manifold, islands: &IslandList) -> Vec<Self> {
        let numbered = islands.islands.iter().enumerate();
        numbered.map(|(k, island)| IslandInfo::new(map, k + 1, island)).collect()
    }

    fn new(map: &Manifold, number: usize, island: &Island) -> Self {
        IslandInfo {
            island: number,
            patches: island.patches.len(),
            robots: island.robots.clone(),
            levels: LevelMetrics::of(map, &island.patches),
        }
    }

    fn to_text(&self) -> String {
        let mut text = format!(
            "island {}: {} of {}",
            self.island,
            patches(self.patches),
            self.robots.join(", ")
        );
        if let Some(levels) = LevelMetrics::all_to_text(&self.levels) {
            let _ = write!(text, "; {levels}");
        }
        text
    }
}

fn relation_counts(map: &Manifold) -> BTreeMap<&'static str, RelationCounts> {
    let mut counts: BTreeMap<_, RelationCounts> = BTreeMap::new();
    for relation in map.relations() {
        let of = counts.entry(provenance_name(relation.provenance)).or_default();
        match relation.state {
            RelationState::Active => of.active += 1,
            RelationState::Provisional => of.provisional += 1,
            RelationState::Retracted(_) => of.retracted += 1,
        }
    }
    counts
}

impl StepInfo {
    fn new(step: &StepSummary) -> Self {
        StepInfo {
            step: step.step,
            time: utc(step.time_unix_ns),
            note: step.note.clone(),
            changes: step.changes,
            scans: step.scans,
        }
    }
}

fn kind_name(kind: LandmarkKind) -> &'static str {
    match kind {
        LandmarkKind::Victim => "victim",
        LandmarkKind::Tag => "tag",
        LandmarkKind::Robot => "robot",
    }
}

/// `1 patch` or `n patches`.
pub fn patches(count: usize) -> String {
    format!("{} {}", grouped(count as u64), if count == 1 { "patch" } else { "patches" })
}

/// Nanoseconds since 1970 as date and time of the Gregorian calendar, UTC. Days are turned into a
/// date by counting years from March, so that the odd day comes last.
fn utc(unix_ns: i64) -> String {
    let secs = unix_ns.div_euclid(1_000_000_000);
    let (days, second) = (secs.div_euclid(86_400) + 719_468, secs.rem_euclid(86_400));
    let (era, day_of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let leap_days = day_of_era / 1_460 - day_of_era / 36_524 + day_of_era / 146_096;
    let year_of_era = (day_of_era - leap_days) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = month_from_march % 12 + 3 - if month_from_march > 9 { 12 } else { 0 };
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        let cases = [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_399, "2000-02-28 23:59:59 UTC"),
            (951_868_799, "2000-02-29 23:59:59 UTC"),
            (1_700_000_000, "2023-11-14 22:13:20 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
            (-1, "1969-12-31 23:59:59 UTC"),
        ];
        for (secs, expected) in cases {
            assert_eq!(utc(secs * 1_000_000_000), expected);
        }
    }
}
