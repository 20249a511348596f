use crate::{Scratch, args, run};
use geometry::{GaussianPose2, Pose2};
use manifold::{Manifold, Patch, PatchId, Provenance};
use sensing::{LaserModel, RobotId, Scan, Stamp};
use std::path::Path;
use std::sync::Arc;
use store::{RobotLog, SqliteStore, Step, Store};

/// A site of two robots with three patches each, joined by a merge that is not confirmed yet.
fn site(file: &Path) {
    let mut map = Manifold::new();
    let mut logs = Vec::new();
    for name in ["anna", "bert"] {
        let robot = map.add_robot(name);
        let (text, joined_unix_ns) = (|s: &str| s.to_owned(), 1_700_000_000_000_000_000);
        logs.push(RobotLog {
            robot,
            name: text(name),
            file: format!("{name}.clf"),
            content_hash: text("crc64:0:0"),
            joined_unix_ns,
            reader_report: text("{\"scans\": 3}"),
        });
        let first = map.patches().len() as u32;
        for i in 0..3 {
            map.add_patch(patch(robot, Pose2::new(f64::from(i), 0.0, 0.0)));
            if i > 0 {
                let step = GaussianPose2::exact(Pose2::new(1.0, 0.0, 0.0));
                let (from, to) = (PatchId(first + i - 1), PatchId(first + i));
                map.relate(from, to, step, Provenance::Sequential);
            }
        }
    }
    let step = GaussianPose2::exact(Pose2::new(5.0, 0.0, 0.0));
    map.propose(PatchId(2), PatchId(3), step, Provenance::Merge);
    let step = Step { note: "two".into(), changes: map.take_journal(), logs, ..Step::default() };
    let mut store = SqliteStore::create(file, "test").unwrap();
    store.write(&step).unwrap();
    store.close().unwrap();
}

fn patch(robot: RobotId, island_from_patch: Pose2) -> Patch {
    Patch {
        id: PatchId::default(),
        robot,
        stamp: Stamp(0),
        scan: Arc::new(Scan::classify(LaserModel::half_circle(3), &[1.0, 2.5, 3.0])),
        sweep: None,
        base_from_laser: Pose2::IDENTITY,
        attitude: None,
        island_from_patch,
        elevation: None,
        left_out: false,
    }
}

#[test]
fn info_tells_what_is_in_a_manifold_file() {
    let scratch = Scratch::new("info");
    let file = scratch.at("site.manifold");
    site(&file);
    let ran = run(args!["info", &file, "--verify"]);
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    for part in [
        "robot 0 (anna): 3 patches",
        "log bert.clf, joined 2023-11-14 22:13:20 UTC",
        "island 2: 3 patches of bert",
        "relations, sequential: 4 active",
        "merge 4, provisional: patches 2 of anna and 3 of bert",
        "step 0, 1970-01-01 00:00:00 UTC: two: 13 changes",
        "verified",
    ] {
        assert!(ran.out.contains(part), "{part:?} missing in {}", ran.out);
    }
    let ran = run(args!["info", &file, "--json"]);
    let info: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(info["islands"][1]["robots"][0], "bert");
    assert_eq!(info["robots"][0]["log"]["reader_report"]["scans"], 3);
    assert_eq!(info["provisional"][0]["relation"], 4);
    assert_eq!(info["findings"], serde_json::Value::Null);
    assert_eq!(scratch.names(), ["site.manifold"]);
}

#[test]
fn damaged_files_are_refused_and_salvaged_with_a_list_of_what_is_lost() {
    let scratch = Scratch::new("salvage");
    let file = scratch.at("site.manifold");
    site(&file);
    let whole = run(args!["salvage", &file, "-o", scratch.at("copy.manifold")]);
    assert_eq!((whole.code, whole.err.as_str()), (0, ""), "{}", whole.out);

    let bytes = std::fs::read(&file).unwrap();
    let broken = scratch.file("broken.manifold", &bytes[..bytes.len() / 2]);
    let ran = run(args!["info", &broken]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("truncated") && ran.err.contains("salvage"), "{}", ran.err);
    let new = scratch.at("new.manifold");
    let ran = run(args!["salvage", &broken, "-o", &new, "--quiet"]);
    assert_eq!((ran.code, ran.out.as_str()), (3, ""), "{}", ran.err);
    assert!(ran.err.lines().all(|line| line.starts_with("lost: ")), "{}", ran.err);
    assert_eq!(run(args!["info", "--verify", &new]).code, 0);

    let again = run(args!["salvage", &broken, "-o", &new]);
    assert_eq!(again.code, 1);
    assert!(again.err.contains("there is a file of that name"), "{}", again.err);
    let text = scratch.file("text", "nothing of the kind\n".repeat(500));
    for command in [args!["info", &text].to_vec(), args!["salvage", &text, "-o", "x"].to_vec()] {
        let ran = run(command);
        assert_eq!(ran.code, 1);
        assert!(ran.err.contains("not a manifold file"), "{}", ran.err);
    }
}
