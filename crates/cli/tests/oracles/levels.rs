use crate::{Scratch, args, names, run};
use serde_json::Value;
use std::fs::read;
use synthetic::{Robot, Storeys, write_carmen};

#[test]
fn every_level_has_a_map_of_its_own() {
    let scratch = Scratch::new("levels");
    let driven = Storeys::default().record(&Robot::default(), 1);
    let mut log = Vec::new();
    write_carmen(&driven.run, &mut log).unwrap();
    let log = scratch.file("storeys.clf", log);
    let ran = run(args!["map", log, "-o", scratch.at("out")]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let files = names(&scratch.at("out"));
    for level in 0..2 {
        for ending in ["png", "pgm", "yaml"] {
            let file = format!("map-level-{level}.{ending}");
            assert!(files.contains(&file), "{file} missing in {files:?}");
        }
    }
    assert!(files.contains(&"map.png".into()) && !files.contains(&"map.pgm".into()), "{files:?}");
    let metrics: Value =
        serde_json::from_slice(&read(scratch.at("out/metrics.json")).unwrap()).unwrap();
    let levels = metrics["islands"][0]["levels"].as_array().unwrap();
    let heights: Vec<f64> =
        levels.iter().map(|level| level["elevation_m"].as_f64().unwrap()).collect();
    let [low, high] = heights[..] else { panic!("{heights:?}") };
    assert!(low.abs() < 0.1 && (high - 3.0).abs() < 0.1, "{heights:?}");
}

#[test]
fn a_log_of_flat_ground_tells_no_levels() {
    let scratch = Scratch::new("no-levels");
    let log = scratch.file("walk.clf", crate::short_log());
    let ran = run(args!["map", log, "-o", scratch.at("out")]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let metrics: Value =
        serde_json::from_slice(&read(scratch.at("out/metrics.json")).unwrap()).unwrap();
    assert_eq!(metrics["islands"][0].get("levels"), None);
    assert!(names(&scratch.at("out")).contains(&"map.pgm".into()));
}
