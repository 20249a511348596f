use crate::{Scratch, args, run};
use std::path::PathBuf;
use std::process::Command;

/// The benchmark's own script, the independent oracle.
fn script() -> Option<PathBuf> {
    let path =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/tools/eval_relations.py");
    let python =
        Command::new("python3").arg("--version").output().is_ok_and(|o| o.status.success());
    if !path.exists() || !python {
        eprintln!("skipped: ../shared/tools/eval_relations.py or python3 is missing");
        return None;
    }
    Some(path)
}

/// A crooked trajectory and relations that fit it badly, in awkward numbers.
fn made_up(scratch: &Scratch, count: usize, missing: usize) -> (PathBuf, PathBuf) {
    let (mut tum, mut relations) = (String::from("# made up\n"), String::new());
    for i in 0..count {
        let t = i as f64;
        let yaw = 3.0 * (t * 0.7).sin();
        let (sin, cos) = (0.5 * yaw).sin_cos();
        tum += &format!(
            "{}.{:04} {:.6} {:.6} 0 0 0 {sin:.9} {cos:.9}\n",
            1000 + i,
            i * 37 % 10000,
            t.cos(),
            t
        );
        let (j, wrong) = ((i * 7 + 3) % count, if i < missing { 5000 } else { 1000 });
        relations += &format!(
            "{}.{:04} {}.{:04} {:.6} {:.6} 0 0 0 {:.6}\n",
            1000 + i,
            i * 37 % 10000,
            wrong + j,
            j * 37 % 10000,
            t.sin(),
            t * 0.01,
            t * 0.3 - 3.0,
        );
    }
    (scratch.file("made.up.tum", tum), scratch.file("made.up.relations", relations))
}

#[test]
fn relations_score_as_the_benchmark_scores_them() {
    let Some(script) = script() else { return };
    let scratch = Scratch::new("scores");
    for (count, missing) in [(40, 0), (101, 3), (50, 20)] {
        let (traj, relations) = made_up(&scratch, count, missing);
        let oracle = Command::new("python3")
            .arg(&script)
            .args(args!["--json", "--relations", &relations, "--traj", &traj])
            .output()
            .unwrap();
        let ran =
            run(args!["eval", "relations", "--json", "--relations", &relations, "--traj", &traj]);
        assert_eq!(Some(ran.code), oracle.status.code(), "{}", ran.err);
        let theirs: serde_json::Value = serde_json::from_slice(&oracle.stdout).unwrap();
        let ours: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
        let theirs = theirs.as_object().unwrap();
        assert_eq!(theirs.len(), ours.as_object().unwrap().len());
        for (name, value) in theirs {
            let (a, b) = (value.as_f64().unwrap(), ours[name].as_f64().unwrap());
            assert!((a - b).abs() <= 1e-9 * (1.0 + a.abs()), "{name}: {a} and {b}");
        }
    }
}

#[test]
fn scores_refuse_what_cannot_be_compared() {
    let scratch = Scratch::new("refuse");
    let (traj, relations) = made_up(&scratch, 10, 0);
    let other = scratch.file("other.tum", "1.0 0 0 0\n");
    let broken = scratch.file("broken.tum", "1.0 0 0 0\n2.0 zero 0 0\n");
    let ran = run(args!["eval", "relations", "--relations", &relations, "--traj", &other]);
    assert!(ran.code == 1 && ran.err.contains("no relation"), "{}", ran.err);
    let ran = run(args!["eval", "ate", "--truth", &traj, "--traj", &other]);
    assert!(ran.code == 1 && ran.err.contains("no stamp in common"), "{}", ran.err);
    let ran = run(args!["eval", "ate", "--truth", &traj, "--traj", &broken]);
    assert!(ran.code == 1 && ran.err.contains("broken.tum:2: field 2"), "{}", ran.err);
}

#[test]
fn relations_are_scored_within_and_across_trajectories() {
    let scratch = Scratch::new("across");
    let (traj, relations) = made_up(&scratch, 40, 0);
    let text = std::fs::read_to_string(&traj).unwrap();
    let lines: Vec<&str> = text.lines().skip(1).collect();
    let part = |range: std::ops::Range<usize>| lines[range].join("\n");
    let (a, b) = (scratch.file("a.tum", part(0..25)), scratch.file("b.tum", part(15..40)));
    let score = |more: &[std::ffi::OsString]| {
        let common = args!["eval", "relations", "--json", "--relations", &relations, "--traj"];
        let ran = run(common.iter().chain(more));
        assert_eq!(ran.code, 0, "{}", ran.err);
        serde_json::from_str::<serde_json::Value>(&ran.out).unwrap()
    };
    let team = score(&args![&a, &b]);
    // In one frame the robots' poses are the single trajectory's.
    assert_eq!(team, score(&args![&traj, "--across-of", &a, &b]));
    let count = |group: &str, what: &str| team[group][what].as_u64().unwrap();
    assert_eq!(count("all", "used"), 40);
    let measured = |group| count(group, "measurements");
    assert_eq!(measured("all"), measured("within") + measured("across"));
    let holds = |i: usize| [i < 25, i >= 15];
    let pairs = (0..40).flat_map(|i| [(i, 0, 1), (i, 1, 0)]);
    let across =
        pairs.filter(|&(i, from, to)| holds(i)[from] && holds((i * 7 + 3) % 40)[to]).count();
    assert_eq!(measured("across"), across as u64);
    let two = args![&a, &b, "--across-of", &a, &b];
    let common = args!["eval", "relations", "--relations", &relations, "--traj"];
    let ran = run(common.iter().chain(&two));
    assert!(ran.code == 1 && ran.err.contains("a single file"), "{}", ran.err);
}
