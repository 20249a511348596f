use crate::{Scratch, args, demo_log, names, run, short_log};
use serde_json::Value;
use std::ffi::OsString;
use std::fs::read;
use std::path::{Path, PathBuf};

/// The demo's log cut into robots that know nothing of each other.
pub fn pieces(scratch: &Scratch, count: usize) -> Vec<PathBuf> {
    let log = scratch.file("walk.clf", demo_log());
    let ran = run(args!["cut", log, "--pieces", count.to_string(), "-o", scratch.at("cut")]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    (1..=count).map(|k| scratch.at(&format!("cut/walk-{k}.clf"))).collect()
}

pub fn map<'a>(
    logs: impl IntoIterator<Item = &'a PathBuf>,
    target: &Path,
    more: &[&str],
) -> crate::Ran {
    let mut args: Vec<OsString> = vec!["map".into(), "-o".into(), target.into()];
    args.extend(logs.into_iter().map(Into::into));
    args.extend(more.iter().map(Into::into));
    run(args)
}

fn metrics(result: &Path) -> Value {
    serde_json::from_slice(&read(result.join("metrics.json")).unwrap()).unwrap()
}

/// The log of the same drive through a building larger by half.
fn enlarged(log: &str) -> String {
    let grown = |field: &str| format!("{:.4}", 1.5 * field.parse::<f64>().unwrap());
    let line = |line: &str| {
        let mut fields: Vec<String> = line.split(' ').map(str::to_owned).collect();
        if fields[0] == "FLASER" {
            let beams: usize = fields[1].parse().unwrap();
            let positions = [0, 1, 3, 4].map(|k| 2 + beams + k);
            for k in (2..2 + beams).chain(positions) {
                fields[k] = grown(&fields[k]);
            }
        }
        fields.join(" ") + "\n"
    };
    log.lines().map(line).collect()
}

#[test]
fn a_run_cut_in_two_is_one_map_in_any_order_on_any_number_of_threads() {
    let scratch = Scratch::new("cut-in-two");
    let logs = pieces(&scratch, 2);
    let (one, two) = (scratch.at("one"), scratch.at("two"));
    let ran = map(&logs, &one, &["--threads", "1"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    for part in ["island 1: walk-1, walk-2", "merged; ", "estimated chance of being wrong"] {
        assert!(ran.out.contains(part), "{part:?} missing in {}", ran.out);
    }
    assert_eq!(map(logs.iter().rev(), &two, &["--threads", "2", "--quiet"]).code, 0);
    let files = names(&one);
    assert_eq!(files, names(&two));
    // Three tell times.
    let timed = ["metrics.json", "report.html", "site.manifold"];
    for file in files.iter().filter(|file| !timed.contains(&file.as_str())) {
        assert!(read(one.join(file)).unwrap() == read(two.join(file)).unwrap(), "{file} differs");
    }
    let site = |result: &Path| store::read(&result.join("site.manifold")).unwrap().site;
    let (one_site, other_site) = (site(&one), site(&two));
    assert!(store::same_map(&one_site.manifold, &other_site.manifold), "another map is stored");
    assert_eq!(one_site.trajectories, other_site.trajectories);
    let told = metrics(&one);
    assert_eq!(told["map"]["islands"], 1);
    assert_eq!(told["islands"][0]["robots"], serde_json::json!(["walk-1", "walk-2"]));
    assert_eq!(told["merges"][0]["state"], "merged");
    let report = std::fs::read_to_string(one.join("report.html")).unwrap();
    assert!(report.contains("Islands that were joined:"));
}

#[test]
fn unlike_buildings_are_islands_with_a_map_each() {
    let scratch = Scratch::new("islands");
    // A name that needs quotes in a table.
    let small = scratch.file("small, \"odd\".clf", short_log());
    let large = scratch.file("large.clf", enlarged(demo_log()));
    let result = scratch.at("out");
    let ran = map([&small, &large], &result, &[]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let expected = [
        "config.toml",
        "graph.g2o",
        "large.tum",
        "map-2.pgm",
        "map-2.png",
        "map-2.yaml",
        "map.pgm",
        "map.png",
        "map.yaml",
        "metrics.json",
        "patches.csv",
        "report.html",
        "site.manifold",
        "small, \"odd\".tum",
    ];
    assert_eq!(names(&result), expected);
    let yaml = std::fs::read_to_string(result.join("map-2.yaml")).unwrap();
    assert!(yaml.contains("map-2.pgm"), "{yaml}");
    let told = metrics(&result);
    assert_eq!(told["islands"][0]["robots"], serde_json::json!(["large"]));
    assert_eq!(told["islands"][1]["robots"], serde_json::json!(["small, \"odd\""]));
    for (island, file) in [("1", "map.pgm"), ("2", "map-2.pgm")] {
        let image = scratch.at("again.pgm");
        let ran = run(args!["render", &result, "--island", island, "-o", &image]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert!(read(&image).unwrap() == read(result.join(file)).unwrap(), "{file} differs");
    }
    let ran = run(args!["render", &result, "--island", "3", "-o", scratch.at("third.png")]);
    assert!(ran.code == 1 && ran.err.contains("has 2 islands"), "{}", ran.err);
    assert!(!scratch.at("third.png").exists());
}

#[test]
fn a_robot_alone_and_beside_a_stranger_has_the_same_poses() {
    let scratch = Scratch::new("stranger");
    let small = scratch.file("small.clf", short_log());
    let large = scratch.file("large.clf", enlarged(demo_log()));
    let (alone, together) = (scratch.at("alone"), scratch.at("together"));
    assert_eq!(map([&small], &alone, &["--quiet"]).code, 0);
    assert_eq!(map([&small, &large], &together, &["--quiet"]).code, 0);
    let of = |folder: &Path| read(folder.join("small.tum")).unwrap();
    assert!(of(&alone) == of(&together));
}

#[test]
fn one_bad_log_costs_the_team_nothing_but_is_told() {
    let scratch = Scratch::new("bad-member");
    let good = scratch.file("good.clf", short_log());
    let bad = scratch.file("bad.clf", "nothing\n");
    let result = scratch.at("out");
    let ran = map([&bad, &good], &result, &[]);
    assert!(ran.code == 1 && ran.err.contains("bad.clf: no scan"), "{}", ran.err);
    assert!(result.join("good.tum").exists() && !result.join("bad.tum").exists());
    let told = metrics(&result);
    assert_eq!(told["logs"].as_array().unwrap().len(), 1);
    assert!(told["failures"][0].as_str().unwrap().contains("bad.clf"));
    let none = scratch.at("none");
    assert_eq!(map([&bad], &none, &[]).code, 1);
    assert!(!none.exists(), "no map, no folder");
}

#[test]
fn logs_of_the_same_name_are_refused_before_any_work() {
    let scratch = Scratch::new("clash");
    std::fs::create_dir(scratch.at("day2")).unwrap();
    let one = scratch.file("walk.clf", short_log());
    let two = scratch.file("day2/walk.log", short_log());
    for more in [&[][..], &["--separately"]] {
        let ran = map([&one, &two], &scratch.at("out"), more);
        assert!(ran.code == 1 && ran.err.contains("rename one of them"), "{}", ran.err);
        assert!(!scratch.at("out").exists());
    }
}
