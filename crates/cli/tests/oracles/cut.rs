use crate::{Scratch, args, demo_log, names, run};
use std::fs::read_to_string;

#[test]
fn a_cut_log_maps_piece_by_piece_and_every_stamp_is_somewhere() {
    let scratch = Scratch::new("cut");
    let log = scratch.file("walk.clf", demo_log());
    let ran = run(args!["cut", &log, "--pieces", "3", "--json", "-o", scratch.at("cut")]);
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    let summary: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    let held: u64 =
        summary["pieces"].as_array().unwrap().iter().map(|p| p["scans"].as_u64().unwrap()).sum();
    assert_eq!(names(&scratch.at("cut")), ["walk-1.clf", "walk-2.clf", "walk-3.clf"]);
    let stamp = |line: &str| line.rsplit(' ').nth(2).unwrap().to_owned();
    let stamps = |text: &str| -> Vec<String> {
        text.lines().filter(|l| l.starts_with("FLASER")).map(stamp).collect()
    };
    let mut pieces = Vec::new();
    for k in 1..=3 {
        let piece = scratch.at(&format!("cut/walk-{k}.clf"));
        pieces.extend(stamps(&read_to_string(&piece).unwrap()));
    }
    let all = stamps(demo_log());
    // Each inner border is widened by 0.15 of a third on both sides.
    let shared = (0.6 * all.len() as f64 / 3.0).round() as usize;
    assert_eq!(pieces.len() as u64, held);
    assert!(pieces.len().abs_diff(all.len() + shared) <= 2, "{} of {}", pieces.len(), all.len());
    pieces.sort();
    pieces.dedup();
    assert_eq!(pieces, all);
    let piece = scratch.at("cut/walk-2.clf");
    let ran = run(args!["map", &piece, "-o", scratch.at("out"), "--quiet"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
}

#[test]
fn frames_come_from_the_seed() {
    let scratch = Scratch::new("cut-seed");
    let log = scratch.file("walk.clf", crate::short_log());
    for (name, seed) in [("a", "5"), ("b", "5"), ("c", "6")] {
        let out = scratch.at(name);
        let ran = run(args!["cut", &log, "--pieces", "2", "--seed", seed, "-o", out, "--quiet"]);
        assert_eq!((ran.code, ran.out.as_str()), (0, ""));
    }
    let first = |name: &str| read_to_string(scratch.at(name).join("walk-1.clf")).unwrap();
    assert!(first("a") == first("b") && first("a") != first("c"));
}

#[test]
fn logs_without_odometry_stay_without() {
    let scratch = Scratch::new("cut-still");
    let line = |i: u32| format!("FLASER 3 1.0 2.0 {i}.5 0 0 0 0 0 0 {i}.25 host 0\n");
    let log = scratch.file("still.clf", (0..10).map(line).collect::<String>());
    let ran = run(args!["cut", &log, "--pieces", "2", "--overlap", "0", "-o", scratch.at("cut")]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let second = read_to_string(scratch.at("cut/still-2.clf")).unwrap();
    assert_eq!(second, (5..10).map(line).collect::<String>());
}

#[test]
fn what_cannot_be_cut_is_refused_with_advice() {
    let scratch = Scratch::new("cut-bad");
    let log =
        scratch.file("two.clf", "FLASER 1 1.0 0 0 0 0 0 0 1 h 0\nFLASER 1 2 0 0 0 1 0 0 2 h 0\n");
    let empty = scratch.file("empty.clf", "# nothing\n");
    for (log, pieces, overlap, code, message) in [
        (&log, "3", "0.1", 1, "2 scans cannot make 3 pieces; ask for fewer with --pieces"),
        (&empty, "2", "0.1", 1, "no scan in it"),
        (&scratch.at("none.clf"), "2", "0.1", 1, "none.clf"),
        (&log, "0", "0.1", 2, "--pieces"),
        (&log, "2", "1.5", 2, "must be a number from 0 to 1"),
    ] {
        let out = scratch.at("out");
        let ran = run(args!["cut", log, "--pieces", pieces, "--overlap", overlap, "-o", &out]);
        assert!(ran.code == code && ran.err.contains(message), "{} {}", ran.code, ran.err);
        assert!(!out.exists());
    }
    // A cut log that lost a line says so.
    let torn = scratch.file("torn.clf", read_to_string(&log).unwrap() + "FLASER 3 1.0\n");
    let ran = run(args!["cut", &torn, "--pieces", "2", "-o", scratch.at("out")]);
    assert!(ran.code == 3 && ran.out.contains("LOST: 1 dropped line"), "{}", ran.out);
}
