//! From a manifold file back to a team that can go on.

use super::keeping::{CONFIG, MERGES, bad_data_key, statistics_key};
use super::{LogFacts, MappedRobot, MappingTimes};
use crate::config::Config;
use anyhow::Result;
use geometry::Pose2;
use manifold::PatchId;
use sensing::{Observation, RobotId};
use slam::{BadStretch, SlamConfig, StageObserver, Statistics, StoredScan, StoredTeam, Team};
use std::collections::BTreeMap;
use std::path::PathBuf;
use store::Site;

/// The team of a manifold file, and what was mapped of its robots.
pub fn resume(
    site: &Site,
    config: SlamConfig,
    observer: Box<dyn StageObserver>,
) -> (Team, Vec<MappedRobot>) {
    let robots = || (0..site.manifold.robots().len()).map(|k| RobotId(k as u16));
    let statistics = |robot| json(site, &statistics_key(robot)).unwrap_or_default();
    let stored = StoredTeam {
        manifold: site.manifold.clone(),
        scans: robots().map(|robot| stored_scans(site, robot)).collect(),
        statistics: robots().map(statistics).collect::<Vec<Statistics>>(),
        bad_stretches: robots().map(|robot| bad_stretches(site, robot)).collect(),
        merges: json(site, MERGES).unwrap_or_default(),
    };
    let team = Team::resume(config, observer, stored);
    (team, robots().map(|robot| mapped_robot(site, robot)).collect())
}

/// What is left out of a robot's log.
pub fn bad_stretches(site: &Site, robot: RobotId) -> Vec<BadStretch> {
    json(site, &bad_data_key(robot)).unwrap_or_default()
}

/// A robot whose log was not mapped to its end.
#[derive(Clone, Copy, Debug)]
pub struct Interrupted {
    /// The robot.
    pub robot: RobotId,
    /// Scans of its log that the file has.
    pub scans: usize,
}

/// The robots whose logs were not mapped to their ends, by the hash of the log.
pub fn interrupted(site: &Site) -> BTreeMap<String, Interrupted> {
    let logs = site.logs.values();
    let interrupted = logs.filter(|log| !site.metadata.contains_key(&statistics_key(log.robot)));
    let entry = |log: &store::RobotLog| {
        let scans = site.trajectories[usize::from(log.robot.0)].len();
        (log.content_hash.clone(), Interrupted { robot: log.robot, scans })
    };
    interrupted.map(entry).collect()
}

/// The configuration of the file's last run, where it tells.
pub fn stored_config(site: &Site) -> Result<Option<Config>> {
    let text = site.metadata.get(CONFIG);
    text.map(|text| Config::parse(text, "the manifold file's configuration")).transpose()
}

fn json<T: serde::de::DeserializeOwned>(site: &Site, key: &str) -> Option<T> {
    serde_json::from_str(site.metadata.get(key)?).ok()
}

/// A robot's scans as they were taken, in the order of its log.
pub fn stored_scans(site: &Site, robot: RobotId) -> Vec<StoredScan> {
    let scans = &site.trajectories[usize::from(robot.0)];
    scans
        .iter()
        .zip(site.taken(robot))
        .map(|(scan, taken)| {
            let at = |patch_from_base: Pose2| slam::ScanPose { patch: scan.patch, patch_from_base };
            let found = at(taken.as_ref().map_or(scan.patch_from_base, |taken| taken.found));
            let observation = taken.and_then(|taken| {
                Some(Observation {
                    robot,
                    stamp: scan.stamp,
                    odom_from_base: scan.odom_from_base,
                    base_from_laser: taken.base_from_laser,
                    scan: taken.scan?.as_ref().clone(),
                    sweep: taken.sweep,
                    attitude: taken.attitude,
                    sightings: Vec::new(),
                })
            });
            let (pose, odom_from_base) = (at(scan.patch_from_base), scan.odom_from_base);
            StoredScan { found, pose, stamp: scan.stamp, odom_from_base, observation }
        })
        .collect()
}

fn mapped_robot(site: &Site, robot: RobotId) -> MappedRobot {
    let scans = &site.trajectories[usize::from(robot.0)];
    let log = site.logs.get(&robot);
    let facts = log.and_then(|log| serde_json::from_str::<LogFacts>(&log.reader_report).ok());
    // A patch was made of the first scan that hangs on it.
    let mut made_of: BTreeMap<PatchId, usize> = BTreeMap::new();
    for (index, scan) in scans.iter().enumerate() {
        made_of.entry(scan.patch).or_insert(index);
    }
    MappedRobot {
        name: site.manifold.robots()[usize::from(robot.0)].name.to_string(),
        log: log.map_or_else(PathBuf::new, |log| PathBuf::from(&log.file)),
        stamps: scans.iter().map(|scan| scan.stamp_text.clone()).collect(),
        patch_scans: made_of.into_values().collect(),
        facts: facts.unwrap_or_default(),
        times: MappingTimes::default(),
    }
}
