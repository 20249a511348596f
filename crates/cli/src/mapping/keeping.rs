//! What the manifold file keeps beside the map, so that everything else can be made from it again.

use super::resuming::interrupted;
use super::{LogFacts, LogSource};
use crate::config::Config;
use crate::site_writer::{SiteWriter, now_unix_ns};
use anyhow::Result;
use sensing::RobotId;
use slam::{ScanPose, Team};
use store::{RobotLog, Site, TrackedScan};

/// Entries of the metadata: the configuration as TOML, ...
pub const CONFIG: &str = "config";
/// ... whether the last run came to its end, ...
pub const STATE: &str = "state";
pub const MAPPING: &str = "mapping";
pub const FINISHED: &str = "finished";
/// ... islands that were joined and those that may be, as JSON.
pub const MERGES: &str = "merges";

/// The entry of the stretches of a robot's log that are left out, as JSON.
pub fn bad_data_key(robot: RobotId) -> String {
    format!("bad-data.{}", robot.0)
}

/// The entry of what a robot's mapping counted, as JSON; it is there when its log is mapped.
pub fn statistics_key(robot: RobotId) -> String {
    format!("statistics.{}", robot.0)
}

/// Notes that a run begins.
pub fn keep_begin(writer: &SiteWriter, config: &Config) {
    let config = config.to_toml();
    writer.write(move |recorder| {
        recorder.set(CONFIG, &config);
        recorder.set(STATE, MAPPING);
        recorder.commit("begin", now_unix_ns())
    });
}

/// Notes which log a robot recorded, and what the reader made of it.
pub fn keep_log(
    writer: &SiteWriter,
    robot: RobotId,
    source: &LogSource,
    facts: &LogFacts,
) -> Result<()> {
    let file = std::path::absolute(&source.path).unwrap_or_else(|_| source.path.clone());
    let log = RobotLog {
        robot,
        name: source.name.clone(),
        file: file.display().to_string(),
        content_hash: source.content_hash()?.to_owned(),
        joined_unix_ns: now_unix_ns(),
        reader_report: serde_json::to_string(facts)?,
    };
    writer.write(move |recorder| {
        let known = recorder.site().logs.get(&robot).map(|known| known.joined_unix_ns);
        let joined_unix_ns = known.unwrap_or(log.joined_unix_ns);
        recorder.set_log(RobotLog { joined_unix_ns, ..log });
        Ok(())
    });
    Ok(())
}

/// Notes that a robot's log is mapped.
pub fn keep_statistics(writer: &SiteWriter, robot: RobotId, team: &Team) {
    // Plain numbers cannot fail to be written.
    let counted = serde_json::to_string(&team.robot_statistics(robot)).unwrap_or_default();
    let bad = serde_json::to_string(team.bad_stretches(robot)).unwrap_or_default();
    writer.write(move |recorder| {
        recorder.set(&bad_data_key(robot), &bad);
        recorder.set(&statistics_key(robot), &counted);
        recorder.commit("log mapped", now_unix_ns())
    });
}

/// Writes the outcome of a global pass, in one step: the map, and where every scan was taken.
pub fn keep_result(writer: &SiteWriter, team: &mut Team, note: &str) {
    let changes = team.take_changes();
    let merges = serde_json::to_string(team.merges()).unwrap_or_default();
    let robots = (0..team.manifold().robots().len()).map(|k| RobotId(k as u16));
    let poses: Vec<Vec<ScanPose>> = robots.map(|robot| team.scan_poses(robot).collect()).collect();
    let note = note.to_owned();
    writer.write(move |recorder| {
        recorder.commit("scans", now_unix_ns())?;
        let scans = placed(recorder.site(), &poses);
        recorder.set(MERGES, &merges);
        if interrupted(recorder.site()).is_empty() {
            recorder.set(STATE, FINISHED);
        }
        recorder.add(changes, scans);
        recorder.commit(&note, now_unix_ns())
    });
}

/// The scans of a site at other poses.
fn placed(site: &Site, poses: &[Vec<ScanPose>]) -> Vec<(RobotId, usize, TrackedScan)> {
    let robots = site.trajectories.iter().zip(poses).enumerate();
    let scans = robots.flat_map(|(k, (scans, poses))| {
        let numbered = scans.iter().zip(poses).enumerate();
        numbered.map(move |(i, (scan, pose))| {
            let ScanPose { patch, patch_from_base } = *pose;
            (RobotId(k as u16), i, TrackedScan { patch, patch_from_base, ..scan.clone() })
        })
    });
    scans.collect()
}
