use crate::{Scratch, args, names, run};
use serde_json::Value;
use std::path::PathBuf;
use synthetic::{Mishap, MishapRun, mishap, write_carmen};

/// The log of a mishap in a file of this name.
fn log(scratch: &Scratch, name: &str, kind: Mishap, seed: u64) -> (MishapRun, PathBuf) {
    let case = mishap(kind, seed);
    let mut text = Vec::new();
    write_carmen(&case.run, &mut text).unwrap();
    let path = scratch.file(name, text);
    (case, path)
}

fn lines(path: PathBuf) -> usize {
    std::fs::read_to_string(path).unwrap().lines().filter(|line| !line.starts_with('#')).count()
}

#[test]
fn a_carried_robot_has_a_trajectory_and_a_map_on_each_island() {
    let scratch = Scratch::new("carried");
    let (case, walk) = log(&scratch, "walk.clf", Mishap::Carried, 6);
    // Another robot is called what a second trajectory would be called.
    let (_, other) = log(&scratch, "walk.2.clf", Mishap::None, 3);
    let result = scratch.at("out");
    let ran = run(args!["map", walk, other, "-o", &result]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let at = format!("{:.6}", case.run.observations[case.bad.start].stamp.as_secs());
    assert!(ran.err.contains(&format!("walk: data went bad at t = {at} s")), "{}", ran.err);
    let told: Value =
        serde_json::from_slice(&std::fs::read(result.join("metrics.json")).unwrap()).unwrap();
    let bad = &told["logs"][0]["bad_data"][0];
    assert_eq!((&bad["fault"], &bad["first_scan"]), (&"lost".into(), &case.bad.start.into()));
    let left_out = bad["scans"].as_u64().unwrap() as usize;
    let files = [lines(result.join("walk.tum")), lines(result.join("walk.3.tum"))];
    assert_eq!(files.iter().sum::<usize>(), case.run.truth.len() - left_out);
    let trajectories = told["logs"][0]["trajectories"].as_array().unwrap();
    let islands: Vec<u64> = trajectories.iter().filter_map(|t| t["island"].as_u64()).collect();
    assert!(islands.len() == 2 && islands[0] < islands[1], "{islands:?}");
    let drawn = names(&result).iter().filter(|name| name.ends_with(".yaml")).count();
    assert_eq!(drawn, told["map"]["islands"].as_u64().unwrap() as usize);
    for island in islands {
        let image = scratch.at("again.pgm");
        let ran = run(args!["render", &result, "--island", island.to_string(), "-o", &image]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let first = if island == 1 { "map.pgm".into() } else { format!("map-{island}.pgm") };
        assert!(std::fs::read(&image).unwrap() == std::fs::read(result.join(first)).unwrap());
        let ran = run(args![
            "render",
            &result,
            "--island",
            island.to_string(),
            "--all-scans",
            "-o",
            &image
        ]);
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    let report = std::fs::read_to_string(result.join("report.html")).unwrap();
    assert!(report.contains("Left out: walk: data went bad"));
}

#[test]
fn a_fallen_robot_s_map_is_that_of_the_log_without_its_end() {
    let scratch = Scratch::new("fallen");
    let (case, walk) = log(&scratch, "walk.clf", Mishap::OnItsSide, 4);
    let text = std::fs::read_to_string(&walk).unwrap();
    std::fs::create_dir(scratch.at("cut")).unwrap();
    let laser = |line: &&str| line.starts_with("FLASER");
    let kept: Vec<&str> = text.lines().filter(laser).take(case.bad.start).collect();
    let short = scratch.file("cut/walk.clf", kept.join("\n") + "\n");
    let (full, cut) = (scratch.at("full"), scratch.at("short"));
    assert_eq!(run(args!["map", "-q", walk, "-o", &full]).code, 0);
    let ran = run(args!["map", "-q", short, "-o", &cut]);
    assert!(ran.code == 0 && ran.err.is_empty(), "{}", ran.err);
    for file in ["walk.tum", "map.pgm", "map.yaml"] {
        let of = |folder: &PathBuf| std::fs::read(folder.join(file)).unwrap();
        assert!(of(&full) == of(&cut), "{file} differs");
    }
}
