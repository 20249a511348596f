use crate::{Scratch, args, demo_log, names, run, short_log};
use std::fs::read;

#[test]
fn the_demo_finds_the_building_and_says_where_to_look() {
    let scratch = Scratch::new("demo");
    let target = scratch.at("out");
    let ran = run(args!["demo", "-o", &target]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    for part in ["error against the truth", ": good", "map.png", "report.html"] {
        assert!(ran.out.contains(part), "{part:?} missing in {}", ran.out);
    }
    let expected = [
        "config.toml",
        "demo.clf",
        "demo.relations",
        "demo.tum",
        "graph.g2o",
        "map.pgm",
        "map.png",
        "map.yaml",
        "metrics.json",
        "patches.csv",
        "report.html",
        "site.manifold",
        "truth.tum",
    ];
    assert_eq!(names(&target), expected);
    assert_eq!(scratch.names(), ["out"]);
    let ran = run(args![
        "eval",
        "ate",
        "--json",
        "--truth",
        target.join("truth.tum"),
        "--traj",
        target.join("demo.tum"),
    ]);
    let score: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    assert!(score["trans_rmse_m"].as_f64().unwrap() < 0.05, "{score}");
    assert!(score["poses"].as_u64().unwrap() > 500, "{score}");
    let ran = run(args![
        "eval",
        "relations",
        "--relations",
        target.join("demo.relations"),
        "--traj",
        target.join("demo.tum"),
    ]);
    assert_eq!(ran.code, 0, "{}{}", ran.out, ran.err);
}

#[test]
fn the_same_log_gives_the_same_bytes_on_any_number_of_threads() {
    let scratch = Scratch::new("same");
    let log = scratch.file("walk.clf", demo_log());
    for (name, threads) in [("a", "1"), ("b", "2"), ("c", "2")] {
        let ran = run(args!["map", &log, "-o", scratch.at(name), "--threads", threads, "--quiet"]);
        assert_eq!((ran.code, ran.out.as_str(), ran.err.as_str()), (0, "", ""));
    }
    for file in ["walk.tum", "graph.g2o", "map.png", "map.pgm", "patches.csv", "config.toml"] {
        let of = |name: &str| read(scratch.at(name).join(file)).unwrap();
        assert!(of("a") == of("b") && of("b") == of("c"), "{file} differs");
    }
}

#[test]
fn every_scan_gets_a_pose_with_its_stamp_verbatim() {
    let scratch = Scratch::new("verbatim");
    // A clock that jumps back and forth, with digits of all lengths.
    let mut log = String::new();
    let mut stamps = Vec::new();
    for (i, line) in short_log().lines().enumerate() {
        let mut fields: Vec<String> = line.split(' ').map(str::to_owned).collect();
        if fields[0] == "FLASER" {
            let place = fields.len() - 3;
            fields[place] = format!("{}.{}", 5000 - (i * 37) % 61, "0".repeat(1 + i % 5));
            stamps.push(fields[place].clone());
        }
        log += &(fields.join(" ") + "\n");
    }
    let log = scratch.file("jumpy.clf", log);
    let ran = run(args!["map", &log, "-o", scratch.at("out"), "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let tum = std::fs::read_to_string(scratch.at("out/jumpy.tum")).unwrap();
    let written: Vec<_> = tum.lines().map(|l| l.split(' ').next().unwrap()).collect();
    assert_eq!(written, stamps);
    let metrics: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(metrics["logs"][0]["scans"], 120);
    assert!(metrics["logs"][0]["stamps_back"].as_u64().unwrap() > 20);
    assert!(metrics["peak_memory_mib"].as_f64().is_none_or(|peak| peak > 1.0 && peak < 500.0));
    let stored: serde_json::Value =
        serde_json::from_slice(&read(scratch.at("out/metrics.json")).unwrap()).unwrap();
    assert_eq!(stored, metrics);
}

#[test]
fn odometry_can_be_switched_off() {
    let scratch = Scratch::new("odometry");
    let log = scratch.file("walk.clf", short_log());
    // A log whose odometry is nonsense maps the same without it as one that has none.
    let nonsense: String = short_log()
        .lines()
        .map(|line| {
            let mut fields: Vec<&str> = line.split(' ').collect();
            let n = fields.len();
            if fields[0] == "FLASER" {
                fields[n - 9..n - 3].fill("0");
            }
            fields.join(" ") + "\n"
        })
        .collect();
    let nonsense = scratch.file("none.clf", nonsense);
    for (log, name) in [(log, "with"), (nonsense, "without")] {
        let ran = run(args!["map", "--odometry", "off", log, "-o", scratch.at(name), "--quiet"]);
        assert_eq!(ran.code, 0, "{}", ran.err);
    }
    assert!(
        read(scratch.at("with/walk.tum")).unwrap() == read(scratch.at("without/none.tum")).unwrap()
    );
    let config = std::fs::read_to_string(scratch.at("with/config.toml")).unwrap();
    assert!(config.contains("enabled = false"), "{config}");
}

#[test]
fn logs_mapped_separately_get_a_folder_each_and_older_results_are_replaced() {
    let scratch = Scratch::new("several");
    let (one, two) = (scratch.file("one.clf", short_log()), scratch.file("two.log", short_log()));
    for _ in 0..2 {
        let ran = run(args!["map", "--separately", "--json", &one, &two, "-o", scratch.at("out")]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let metrics: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
        assert_eq!(metrics.as_array().unwrap().len(), 2);
        assert_eq!(names(&scratch.at("out")), ["one", "two"]);
    }
    let bad = scratch.file("bad.clf", "nothing\n");
    let mixed = run(args!["map", "--separately", "--json", &bad, &one, "-o", scratch.at("mixed")]);
    assert!(mixed.code == 1 && mixed.err.contains("bad.clf: no scan"), "{}", mixed.err);
    assert_eq!(names(&scratch.at("mixed")), ["one"], "one bad log costs the others nothing");
    let metrics: serde_json::Value = serde_json::from_str(&mixed.out).unwrap();
    assert_eq!(metrics.as_array().unwrap().len(), 1);
    let twice = run(args!["map", &one, &one, "-o", scratch.at("twice")]);
    assert!(twice.code == 1 && twice.err.contains("two logs"), "{}", twice.err);
}

/// Several robots give one result, whatever the order of their logs and the number of threads.
#[test]
fn several_robots_give_one_result_in_any_order() {
    let scratch = Scratch::new("team");
    let (one, two) = (scratch.file("one.clf", short_log()), scratch.file("two.log", short_log()));
    let (first, second) = (scratch.at("first"), scratch.at("second"));
    let ran = run(args!["map", "--threads", "1", &one, &two, "-o", &first]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(run(args!["map", "--threads", "2", &two, &one, "-o", &second]).code, 0);
    for file in ["one.tum", "two.tum", "graph.g2o", "map.png", "patches.csv"] {
        assert_eq!(read(first.join(file)).unwrap(), read(second.join(file)).unwrap(), "{file}");
    }
    let metrics: serde_json::Value =
        serde_json::from_slice(&read(first.join("metrics.json")).unwrap()).unwrap();
    assert_eq!(metrics["logs"].as_array().unwrap().len(), 2);
    assert!(!metrics["islands"].as_array().unwrap().is_empty());
}

#[test]
fn drawing_again_gives_the_same_map_and_others() {
    let scratch = Scratch::new("render");
    let log = scratch.file("walk.clf", short_log());
    let result = scratch.at("out");
    assert_eq!(run(args!["map", &log, "-o", &result]).code, 0);
    let render = |name: &str, more: &[&str]| {
        let mut args = args!["render", &result, "-o", scratch.at(name), "--quiet"].to_vec();
        args.extend(more.iter().map(Into::into));
        let ran = run(args);
        assert_eq!(ran.code, 0, "{name}: {}", ran.err);
        read(scratch.at(name)).unwrap()
    };
    assert!(render("again.pgm", &[]) == read(result.join("map.pgm")).unwrap());
    assert!(scratch.at("again.yaml").exists());
    let fine = render("fine.png", &["--resolution", "0.02", "--crop=-2,-2,3,1.5", "--bare"]);
    assert_eq!(&fine[..8], b"\x89PNG\r\n\x1a\n");
    // Width and height of the image header: the crop's metres in cells of 2 cm.
    assert_eq!((&fine[16..20], &fine[20..24]), (&[0, 0, 0, 250][..], &[0, 0, 0, 175][..]));
    assert!(render("plan.svg", &["--all-scans"]).starts_with(b"<svg"));
    let ran = run(args![
        "render",
        result.join("walk.tum"),
        "--log",
        &log,
        "-o",
        scratch.at("from-tum.png"),
    ]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let other = scratch.file(
        "other.clf",
        short_log().replace("FLASER 181 ", "FLASER 181  ").replace(" nohost", "1 nohost"),
    );
    for (source, log, name) in [
        (&result.join("walk.tum"), &other, "wrong-log.png"),
        (&result, &log, "needs-no-log.png"),
        (&result, &log, "wrong-ending.bmp"),
        (&scratch.at("nowhere"), &log, "missing.png"),
    ] {
        let ran = run(args!["render", source, "--log", log, "-o", scratch.at(name)]);
        assert_eq!(ran.code, 1, "{name}");
        assert!(!scratch.at(name).exists() && !ran.err.is_empty());
    }
    assert!(scratch.names().iter().all(|name| !name.starts_with('.')), "{:?}", scratch.names());
}

#[test]
fn pose_graphs_are_optimised() {
    let scratch = Scratch::new("optimize");
    let graph = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0.5 0\n\
        EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n";
    let (input, output) = (scratch.file("in.g2o", graph), scratch.at("out.g2o"));
    let ran = run(args!["optimize", &input, "-o", &output, "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let summary: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    assert!(summary["final_cost"].as_f64().unwrap() < 1e-9, "{summary}");
    let text = std::fs::read_to_string(&output).unwrap();
    let last = text.lines().find(|l| l.starts_with("VERTEX_SE2 2 ")).unwrap();
    let y: f64 = last.split(' ').nth(4).unwrap().parse().unwrap();
    assert!(y.abs() < 1e-6, "{last}");

    let lossy = scratch.file("lossy.g2o", format!("{graph}EDGE_SE2 0 1 oops\n"));
    let ran = run(args!["optimize", &lossy, "-o", &output]);
    assert!(ran.code == 3 && ran.out.contains("LOST: line 6"), "{}{}", ran.out, ran.err);
    let empty = scratch.file("empty.g2o", "");
    let none = scratch.at("none.g2o");
    let ran = run(args!["optimize", &empty, "-o", &none]);
    assert!(ran.code == 1 && !none.exists(), "{}", ran.err);
}

#[test]
fn wrong_closures_are_found_and_left_out() {
    // Three laps around a square of 4 m in steps of 1 m; every place is recognised a lap later.
    let step = |i: usize| if i % 4 == 3 { "1 0 1.5707963267948966" } else { "1 0 0" };
    let information = "400 0 0 400 0 1600";
    let mut graph = String::new();
    for i in 0..47 {
        graph += &format!("EDGE_SE2 {i} {} {} {information}\n", i + 1, step(i));
    }
    for i in 0..32 {
        graph += &format!("EDGE_SE2 {i} {} 0 0 0 {information}\n", i + 16);
    }
    let right = graph.lines().count();
    for (a, b) in [(2, 25), (5, 33), (8, 46)] {
        graph += &format!("EDGE_SE2 {a} {b} 0.3 0.1 0.5 {information}\n");
    }
    let scratch = Scratch::new("robust");
    let (input, output) = (scratch.file("in.g2o", graph), scratch.at("out.g2o"));
    let ran = run(args!["optimize", "--robust", &input, "-o", &output, "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let summary: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
    assert_eq!(summary["rejected_edges"], 3, "{summary}");
    let text = std::fs::read_to_string(&output).unwrap();
    assert_eq!(text.lines().filter(|l| l.starts_with("EDGE_SE2")).count(), right);
}

#[test]
fn the_configuration_shown_is_the_configuration_used() {
    let scratch = Scratch::new("config");
    let shown = run(["config", "show", "--odometry", "off", "--resolution", "0.02"]);
    assert_eq!(shown.code, 0);
    let file = scratch.file("my.toml", &shown.out);
    assert_eq!(run(args!["config", "show", "--config", file]).out, shown.out);
    assert!(shown.out.contains("resolution_m = 0.02"), "{}", shown.out);
    let bad = scratch.file("bad.toml", "nonsense = 1\n[map]\nresolution_m = -3\n");
    let ran = run(args!["config", "show", "--config", bad]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("nonsense") && ran.err.contains("map.resolution_m"), "{}", ran.err);
}

#[test]
fn help_has_examples_and_usage_errors_have_their_code() {
    for command in [vec![], vec!["map"], vec!["optimize"], vec!["render"], vec!["eval", "ate"]] {
        let ran = run(command.iter().copied().chain(["--help"]));
        assert!(ran.code == 0 && ran.out.contains("Example"), "{command:?}: {}", ran.out);
    }
    for wrong in [
        &["map"][..],
        &["fly"],
        &["map", "x.clf"],
        &["map", "x.clf", "-o", "out", "--threads", "0"],
        &["map", "x.clf", "-o", "out", "--odometry", "maybe"],
        &["render", "out", "-o", "x.png", "--crop", "1,2,3"],
    ] {
        assert_eq!(run(wrong).code, 2, "{wrong:?}");
    }
}
