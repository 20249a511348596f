use crate::editing::assert_an_interruption_leaves_no_trace;
use crate::{Scratch, args, names, run};
use serde_json::Value;
use std::fs::read;
use std::ops::Range;
use std::path::PathBuf;
use synthetic::{Robot, Run, Storeys, StoreysRun, write_carmen};

/// Writes a part of a drive as a log.
fn log(scratch: &Scratch, name: &str, driven: &StoreysRun, scans: Range<usize>) -> PathBuf {
    let Run { plan, truth, observations } = &driven.run;
    let (truth, observations) = (truth[scans.clone()].to_vec(), observations[scans].to_vec());
    let mut log = Vec::new();
    write_carmen(&Run { plan: plan.clone(), truth, observations }, &mut log).unwrap();
    scratch.file(name, log)
}

#[test]
fn every_level_has_a_map_of_its_own() {
    let scratch = Scratch::new("levels");
    let driven = Storeys::default().record(&Robot::default(), 1);
    let log = log(&scratch, "storeys.clf", &driven, 0..driven.run.truth.len());
    let ran = run(args!["map", log, "-o", scratch.at("out")]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("2 levels at 0.0, 3."), "{}", ran.out);
    let told = run(args!["info", scratch.at("out/site.manifold")]);
    assert!(told.out.contains("of storeys; 2 levels at 0.0, 3."), "{}", told.out);
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

/// `render` draws from the manifold file what `map` has drawn.
#[test]
fn levels_are_drawn_again_as_they_were() {
    let scratch = Scratch::new("levels-again");
    let driven = Storeys::default().record(&Robot::default(), 3);
    let log = log(&scratch, "storeys.clf", &driven, 0..driven.run.truth.len());
    let out = scratch.at("out");
    assert_eq!(run(args!["map", log, "-o", &out, "--quiet"]).code, 0);
    let render = |image: &str, more: &[&str]| {
        let mut args = args!["render", &out, "-o", scratch.at(image)].to_vec();
        args.extend(more.iter().map(Into::into));
        run(args)
    };
    let same = |one: &str, other: &str| {
        assert!(read(scratch.at(one)).unwrap() == read(out.join(other)).unwrap(), "{one}");
    };
    let ran = render("again.png", &[]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("2 levels, each"), "{}", ran.out);
    same("again.png", "map.png");
    same("again-level-0.png", "map-level-0.png");
    same("again-level-1.png", "map-level-1.png");
    assert_eq!(render("up.pgm", &["--level", "1"]).code, 0);
    same("up.pgm", "map-level-1.pgm");
    assert!(scratch.at("up.yaml").exists() && !scratch.at("up-level-1.pgm").exists());
    assert_eq!(render("both.pgm", &[]).code, 0);
    same("both-level-0.pgm", "map-level-0.pgm");
    assert!(!scratch.at("both.pgm").exists(), "several levels have no map in common");
    let ran = render("roof.png", &["--level", "2"]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("there is no level 2: the map has 2"), "{}", ran.err);
    assert!(!scratch.at("roof.png").exists());
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

/// Scans of a leaning robot that are kept in the manifold file are levelled again as they were.
#[test]
fn an_interrupted_run_through_storeys_goes_on_to_the_same_map() {
    let scratch = Scratch::new("interrupted-storeys");
    let driven = Storeys::default().record(&Robot::default(), 1);
    let scans = driven.run.truth.len();
    let logs = [
        log(&scratch, "up.clf", &driven, 0..7 * scans / 10),
        log(&scratch, "down.clf", &driven, scans / 2..scans),
    ];
    assert_an_interruption_leaves_no_trace(&scratch, &logs);
    assert!(names(&scratch.at("out")).contains(&"map-level-1.png".into()), "one map of two levels");
}
