//! Maps a log with one robot, writes the manifold file as it goes, and says what that takes.
//!
//!     site_size LOG FILE [CHANGES AND SCANS A STEP]

// A program that measures stops where it cannot go on.
#![allow(clippy::unwrap_used)]

use logs::{CarmenReader, LogFile, ReadOptions};
use manifold::{Change, Robot};
use manifoldslam_store::{COMMIT_EVERY, Recorder, SqliteStore, TrackedScan, read, verify};
use sensing::{Observation, RobotId};
use slam::{Event, Mapper, SlamConfig};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (log, file) = (Path::new(&args[0]), Path::new(&args[1]));
    let every = args.get(2).map_or(COMMIT_EVERY, |n| n.parse().unwrap());
    let mut recorder = Recorder::new(SqliteStore::create(file, "site_size").unwrap(), every);
    let robot = Robot { id: RobotId(0), name: Arc::from("robot") };
    recorder.record([Change::RobotJoined(robot)], [], 0).unwrap();
    let mut mapper = Mapper::new(SlamConfig::default());
    let mut scans: Vec<TrackedScan> = Vec::new();
    let (mut writing, start) = (Duration::ZERO, Instant::now());
    let reader = CarmenReader::new(LogFile::open(log).unwrap().input, ReadOptions::default());
    for record in reader {
        let Observation { stamp, odom_from_base, .. } = record.observation;
        let events = mapper.step(record.observation);
        scans.push(TrackedScan {
            stamp_text: record.stamp_text,
            stamp,
            patch: Default::default(),
            patch_from_base: geometry::Pose2::IDENTITY,
            odom_from_base,
        });
        writing += record_events(&mut recorder, events, &mut scans);
    }
    writing += record_events(&mut recorder, mapper.finish(), &mut scans);
    let closing = Instant::now();
    recorder.commit("refit", 0).unwrap();
    recorder.close().unwrap();
    writing += closing.elapsed();
    println!(
        "mapped in {:.2} s, of which writing {:.2} s",
        start.elapsed().as_secs_f64(),
        writing.as_secs_f64()
    );
    report(file);
}

fn record_events(
    recorder: &mut Recorder<SqliteStore>,
    events: Vec<Event>,
    scans: &mut [TrackedScan],
) -> Duration {
    let (mut changes, mut tracked) = (Vec::new(), Vec::new());
    for event in events {
        match event {
            // The robot has joined already.
            Event::Map(Change::RobotJoined(_)) => {}
            Event::Map(change) => changes.push(change),
            Event::Localised(index, pose) => {
                scans[index].patch = pose.patch;
                scans[index].patch_from_base = pose.patch_from_base;
                tracked.push((RobotId(0), index, scans[index].clone()));
            }
        }
    }
    let start = Instant::now();
    recorder.record(changes, tracked, 0).unwrap();
    start.elapsed()
}

fn report(file: &Path) {
    let start = Instant::now();
    let found = read(file).unwrap();
    println!("opened and checked in {:.3} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    assert_eq!(verify(file).unwrap(), []);
    println!("verified in {:.3} s", start.elapsed().as_secs_f64());
    let patches = found.site.manifold.patches().len();
    let bytes = std::fs::metadata(file).unwrap().len();
    let per_patch = |bytes: u64| bytes as f64 / patches as f64;
    let database = rusqlite::Connection::open(file).unwrap();
    let sum = |sql: &str| database.query_row(sql, [], |row| row.get::<_, i64>(0)).unwrap() as u64;
    let packed = sum("SELECT sum(length(data)) FROM scans");
    let beams = sum("SELECT sum(beams) FROM scans");
    let journal = sum("SELECT sum(length(payload)) FROM changes");
    let moved = sum("SELECT sum(length(payload)) FROM changes WHERE kind = 'poses-reestimated'");
    println!("{patches} patches, {} changes, {} steps", found.changes, found.site.steps.len());
    println!("file {bytes} bytes, {:.0} a patch", per_patch(bytes));
    println!(
        "scans {packed} bytes, {:.0} a patch, {:.2} a beam",
        per_patch(packed),
        packed as f64 / beams as f64
    );
    println!("journal {journal} bytes, {moved} of them re-estimated poses");
}
