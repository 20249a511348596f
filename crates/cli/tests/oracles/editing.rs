//! Maps that are gone on with, taken back, and interrupted.

use crate::teams::{map, pieces};
use crate::{Scratch, args, names, run};
use manifold::{Provenance, RelationState};
use std::fs::read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use store::Site;

/// The relations of a kind that hold, by name.
fn holding(site: &Site, provenance: Provenance) -> Vec<String> {
    let relations = site.manifold.active_relations().filter(|r| r.provenance == provenance);
    relations.map(|r| r.id.0.to_string()).collect()
}

fn stored(result: &Path) -> Site {
    assert_eq!(store::verify(&result.join("site.manifold")).unwrap(), []);
    store::read(&result.join("site.manifold")).unwrap().site
}

fn trajectory(result: &Path, name: &str) -> Vec<u8> {
    read(result.join(format!("{name}.tum"))).unwrap()
}

#[test]
fn a_robot_is_added_split_off_and_confirmed_again() {
    let scratch = Scratch::new("editing");
    let logs = pieces(&scratch, 2);
    let (out, alone) = (scratch.at("out"), scratch.at("alone"));
    assert_eq!(map([&logs[0]], &out, &["--quiet"]).code, 0);
    assert_eq!(map([&logs[1]], &alone, &["--quiet"]).code, 0);
    let site = out.join("site.manifold");
    let ran = run(args!["map", &logs[1], "--onto", &site]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("island 1: walk-1, walk-2"), "{}", ran.out);
    let joined = stored(&out);
    assert_eq!(joined.metadata["state"], "finished");
    let before = [trajectory(&out, "walk-1"), trajectory(&out, "walk-2")];

    // What is split off is the map that the robot has by itself, byte by byte.
    let ran = run(args!["edit", &site, "--split", "walk-2"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("split walk-2; 1 -> 2 islands"), "{}", ran.out);
    assert!(trajectory(&out, "walk-2") == trajectory(&alone, "walk-2"));
    assert!(out.join("map-2.png").exists());
    let merges = holding(&joined, Provenance::Merge);
    let taken_back = stored(&out);
    assert_eq!(holding(&taken_back, Provenance::Merge), Vec::<String>::new());
    assert_eq!(taken_back.manifold.relations().len(), joined.manifold.relations().len());

    // What a user has split is not joined again by itself, ...
    let ran = run(args!["map", &logs[1], "--onto", &site]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.err.contains("is in the map already"), "{}", ran.err);
    assert_eq!(stored(&out).manifold.islands().len(), 2);
    // ... and what the user confirms is as it was.
    let across = joined
        .manifold
        .active_relations()
        .filter(|r| joined.manifold.patch(r.from).robot != joined.manifold.patch(r.to).robot);
    let mut confirm = args!["edit", &site, "--quiet"].to_vec();
    for id in across.map(|r| r.id.0.to_string()) {
        confirm.extend(["--confirm".into(), id.into()]);
    }
    let ran = run(confirm);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(!merges.is_empty());
    assert_eq!(holding(&stored(&out), Provenance::Merge), merges);
    assert!([trajectory(&out, "walk-1"), trajectory(&out, "walk-2")] == before);
    assert!(!out.join("map-2.png").exists(), "the map of an island that is no more");
}

#[test]
fn a_closure_taken_back_leaves_the_map_without_it() {
    let scratch = Scratch::new("retracting");
    let logs = pieces(&scratch, 1);
    let out = scratch.at("out");
    assert_eq!(map(&logs, &out, &["--quiet"]).code, 0);
    let closures = holding(&stored(&out), Provenance::LoopClosure);
    let listed = run(args!["info", "--relations", out.join("site.manifold")]).out;
    for id in &closures {
        assert!(listed.contains(&format!("loop-closure {id}, active: patches ")), "{listed}");
    }
    let site = out.join("site.manifold");
    let ran = run(args!["edit", &site, "--retract", &closures[0]]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let found = stored(&out);
    let id: usize = closures[0].parse().unwrap();
    assert!(matches!(found.manifold.relations()[id].state, RelationState::Retracted(_)));
    assert_eq!(found.steps.last().unwrap().note, format!("retracted {id}"));

    for (wrong, reason) in [
        (args!["edit", &site, "--retract", &closures[0]].to_vec(), "is taken back already"),
        (args!["edit", &site, "--retract", "0"].to_vec(), "is a robot's own way"),
        (args!["edit", &site, "--retract", "99999"].to_vec(), "no relation 99999"),
        (args!["edit", &site, "--confirm", "0"].to_vec(), "is part of the map already"),
        (args!["edit", &site, "--split", "bert"].to_vec(), "the map's robots are walk-1"),
    ] {
        let before = stored(&out).steps.len();
        let ran = run(wrong);
        assert_eq!(ran.code, 1);
        assert!(ran.err.contains(reason), "{reason:?} missing in {}", ran.err);
        assert_eq!(stored(&out).steps.len(), before, "{reason}: the file has changed");
    }
    assert_eq!(run(args!["edit", &site]).code, 2);
}

#[test]
fn a_robot_left_out_is_not_drawn_and_comes_back() {
    let scratch = Scratch::new("left-out");
    let logs = pieces(&scratch, 2);
    let out = scratch.at("out");
    assert_eq!(map(&logs, &out, &["--quiet"]).code, 0);
    let (whole, site) = (read(out.join("map.pgm")).unwrap(), out.join("site.manifold"));
    let ran = run(args!["edit", &site, "--leave-out", "walk-2"]);
    assert_eq!(ran.code, 0);
    let told = ["left out of the map", "island 1: walk-1 ("];
    assert!(told.iter().all(|part| ran.out.contains(part)), "{}", ran.out);
    assert!(!ran.out.contains("merged;"), "{}", ran.out);
    assert!(read(out.join("map.pgm")).unwrap() != whole);
    let out_now = stored(&out).manifold.patches().iter().filter(|p| p.left_out).count();
    assert!(out_now > 0);
    assert!(!out.join("walk-2.tum").exists() && out.join("walk-1.tum").exists());
    assert_eq!(run(args!["edit", &site, "--take-in", "walk-2", "--quiet"]).code, 0);
    assert!(read(out.join("map.pgm")).unwrap() == whole);
    assert!(out.join("walk-2.tum").exists());
}

#[test]
fn a_name_that_the_map_has_is_refused() {
    let scratch = Scratch::new("same-name");
    let logs = pieces(&scratch, 2);
    let out = scratch.at("out");
    assert_eq!(map([&logs[0]], &out, &["--quiet"]).code, 0);
    std::fs::create_dir(scratch.at("other")).unwrap();
    let other = scratch.at("other/walk-1.clf");
    std::fs::copy(&logs[1], &other).unwrap();
    let ran = run(args!["map", &other, "--onto", out.join("site.manifold")]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("the map has a robot of this name"), "{}", ran.err);
    assert_eq!(stored(&out).manifold.robots().len(), 1);
}

/// Starts mapping and kills it when the file holds something of the last robot.
fn interrupt(logs: &[PathBuf], out: &Path, robots: usize) {
    let mut mapping = Command::new(env!("CARGO_BIN_EXE_manifoldslam"))
        .arg("map")
        .args(logs)
        .args(["--threads".as_ref(), "1".as_ref(), "-o".as_ref(), out.as_os_str()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = || {
        let found = store::read(&out.join("site.manifold"));
        found.is_ok_and(|found| {
            found.site.trajectories.get(robots - 1).is_some_and(|t| t.len() > 200)
        })
    };
    while !began() {
        assert_eq!(mapping.try_wait().unwrap(), None, "mapped before it was killed");
        std::thread::sleep(Duration::from_millis(2));
    }
    mapping.kill().unwrap();
    mapping.wait().unwrap();
}

/// Maps logs at one go, and again with an interruption in the last of them: the results must be the
/// same byte by byte, but for times.
pub fn assert_an_interruption_leaves_no_trace(scratch: &Scratch, logs: &[PathBuf]) {
    let (whole, out) = (scratch.at("whole"), scratch.at("out"));
    assert_eq!(map(logs, &whole, &["--quiet"]).code, 0);
    interrupt(logs, &out, logs.len());
    assert_eq!(stored(&out).metadata["state"], "mapping");
    let ran = run(args!["info", out.join("site.manifold")]);
    assert!(ran.out.contains("state: mapping"), "{}", ran.out);
    let mut onto = args!["map", "--onto", out.join("site.manifold"), "--quiet"].to_vec();
    onto.extend(logs.iter().map(Into::into));
    let ran = run(onto);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(store::same_map(&stored(&out).manifold, &stored(&whole).manifold));
    assert_eq!(names(&out), names(&whole));
    let with_times = ["metrics.json", "report.html", "site.manifold"];
    for name in names(&whole).iter().filter(|name| !with_times.contains(&name.as_str())) {
        assert!(read(out.join(name)).unwrap() == read(whole.join(name)).unwrap(), "{name}");
    }
}

#[test]
fn an_interrupted_run_goes_on_to_the_same_map() {
    let scratch = Scratch::new("interrupted");
    assert_an_interruption_leaves_no_trace(&scratch, &pieces(&scratch, 2));
}
