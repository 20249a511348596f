//! Landmarks through the program: from lines of a log, or a table beside it, to one map.

use crate::{Ran, Scratch, args, names, run};
use geometry::{Pose2, Vector2};
use sensing::LandmarkKind;
use serde_json::Value;
use std::fmt::Write;
use std::fs::{read, read_to_string};
use std::path::{Path, PathBuf};
use synthetic::{Landmark, LandmarkSensor, Run, two_loop_building, write_carmen};

const IDS: [Option<&str>; 5] = [Some("a, b"), Some("exit"), Some("7"), Some("8"), None];

/// The two-loop building's run cut in two that share some of the way, and landmarks beside that.
fn halves() -> ([Run; 2], Vec<Landmark>) {
    let whole = two_loop_building(1);
    let place = |k: usize| whole.truth[k].transform(Vector2::new(1.5, 0.5));
    let landmark = |(i, id): (usize, &Option<&str>)| Landmark {
        kind: if id.is_some() { LandmarkKind::Tag } else { LandmarkKind::Victim },
        id: id.map(Into::into),
        position: place(290 + 20 * i),
    };
    let landmarks = IDS.iter().enumerate().map(landmark).collect();
    let part = |scans: std::ops::Range<usize>, odom: Pose2| {
        let mut observations = whole.observations[scans.clone()].to_vec();
        for observation in &mut observations {
            observation.odom_from_base = observation.odom_from_base.map(|pose| odom * pose);
        }
        Run { plan: whole.plan.clone(), truth: whole.truth[scans].to_vec(), observations }
    };
    let second = part(280..whole.truth.len(), Pose2::new(-40.0, 17.0, 2.0)).of_robot(1);
    ([part(0..400, Pose2::IDENTITY), second], landmarks)
}

/// A run as a log. An id with blanks does not fit a line.
fn log(run: &Run) -> String {
    let mut text = Vec::new();
    write_carmen(run, &mut text).unwrap();
    String::from_utf8(text).unwrap().replace("a, b", "a,b")
}

/// A run's landmarks as a table of their own.
fn table(run: &Run) -> String {
    let mut text = String::from("stamp,kind,id,x_m,y_m,cov_xx_m2,cov_xy_m2,cov_yy_m2\n");
    for observation in &run.observations {
        for seen in &observation.sightings {
            let kind = if seen.id.is_some() { "tag" } else { "victim" };
            let id = seen.id.as_deref().unwrap_or_default();
            let (secs, c) = (observation.stamp.0 as f64 * 1e-9, &seen.covariance);
            let (x, y) = (seen.position.x, seen.position.y);
            let spread = format!("{},{},{}", c[(0, 0)], c[(0, 1)], c[(1, 1)]);
            writeln!(text, "{secs:.6},{kind},{id},{x},{y},{spread}").unwrap();
        }
    }
    text
}

fn map(logs: &[PathBuf], target: &Path, config: &Path) -> Ran {
    let mut args = args!["map", "-o", target, "--config", config].to_vec();
    args.extend(logs.iter().map(Into::into));
    run(args)
}

fn metrics(result: &Path) -> Value {
    serde_json::from_slice(&read(result.join("metrics.json")).unwrap()).unwrap()
}

#[test]
fn landmarks_alone_make_one_map_of_two_logs() {
    let scratch = Scratch::new("landmarks");
    let ([mut one, mut two], mut landmarks) = halves();
    landmarks[0].id = Some("a,b".into());
    LandmarkSensor::default().see(&mut one, &landmarks, 1);
    // In a table an id must not have the comma that a line may have: the second reads another.
    landmarks[0].id = Some("8".into());
    LandmarkSensor::default().see(&mut two, &landmarks, 2);
    let told = table(&two);
    two.observations.iter_mut().for_each(|o| o.sightings.clear());
    let logs = [scratch.file("one.clf", log(&one)), scratch.file("two.clf", log(&two))];
    scratch.file("two.clf.landmarks.csv", &told);
    let config = scratch.file("c.toml", "[slam.merging]\ngeometry = false\n");
    let result = scratch.at("out");
    let ran = map(&logs, &result, &config);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("landmarks agreeing"), "{}", ran.out);
    let figures = metrics(&result);
    assert_eq!(figures["map"]["islands"], 1, "{}", ran.out);
    assert_eq!(figures["merges"][0]["provenance"], "landmark");
    assert_eq!(figures["map"]["relations"]["merge"], Value::Null);
    let rows = told.lines().count() - 1;
    assert_eq!(figures["logs"][1]["sightings"], rows);
    assert!(names(&result).contains(&"landmarks.csv".into()));
    let csv = read_to_string(result.join("landmarks.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "id,kind,island,x_m,y_m,std_m,sightings,robots");
    assert_eq!(figures["map"]["landmarks"], lines.len() - 1);
    let of = |start: &str| lines.iter().filter(|line| line.starts_with(start)).count();
    assert_eq!((of("exit,tag,1,"), of("7,tag,1,"), of(",victim,1,")), (1, 1, 1), "{csv}");
    // Read as another, it is told where it was seen, by whom; the one that it is not stays apart.
    assert_eq!((of("\"a,b\",tag,1,"), of("8,tag,1,")), (1, 2), "{csv}");
    assert!(lines.iter().any(|l| l.starts_with("exit") && l.ends_with(",one;two")), "{csv}");
    let report = read_to_string(result.join("report.html")).unwrap();
    assert!(report.contains("landmark: 6"), "each is drawn");
}

#[test]
fn the_same_logs_without_landmarks_are_two_islands_and_have_no_table() {
    let scratch = Scratch::new("no-landmarks");
    let ([one, two], _) = halves();
    let logs = [scratch.file("one.clf", log(&one)), scratch.file("two.clf", log(&two))];
    let config = scratch.file("c.toml", "[slam.merging]\ngeometry = false\n");
    let result = scratch.at("out");
    assert_eq!(map(&logs, &result, &config).code, 0);
    assert_eq!(metrics(&result)["map"]["islands"], 2);
    assert!(!names(&result).contains(&"landmarks.csv".into()));
}

#[test]
fn rows_that_cannot_be_used_are_lost_and_told() {
    let scratch = Scratch::new("bad-landmarks");
    let path = scratch.file("short.clf", crate::short_log());
    let first = crate::short_log().lines().find(|l| l.starts_with("FLASER")).unwrap().to_owned();
    let stamp = first.split(' ').next_back().unwrap().to_owned();
    let table =
        format!("stamp,kind,id,x_m,y_m,std_m\n{stamp},tag,1,1,0,0.1\n{stamp},ghost,1,1,0,0.1\n");
    scratch.file("short.clf.landmarks.csv", table);
    let ran = run(args!["map", &path, "-o", scratch.at("out")]);
    assert_eq!(ran.code, 3, "{}", ran.err);
    assert!(ran.out.contains("not a kind of landmark"), "{}", ran.out);
    let csv = read_to_string(scratch.at("out/landmarks.csv")).unwrap();
    assert_eq!(csv.lines().count(), 2);
    scratch.file("short.clf.landmarks.csv", "stamp,x\n");
    let ran = run(args!["map", &path, "-o", scratch.at("again")]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("short.clf.landmarks.csv:1:"), "{}", ran.err);
}
