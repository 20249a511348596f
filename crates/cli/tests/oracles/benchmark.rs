use crate::{Scratch, args, names, run, short_log};
use std::fs::read_to_string;

#[test]
fn matchers_are_compared_into_a_folder() {
    let scratch = Scratch::new("bench");
    let target = scratch.at("out");
    let ran = run(args![
        "bench",
        "matchers",
        "--repeats",
        "1",
        "--matcher",
        "plicp",
        "--situation",
        "lobby",
        "-o",
        &target,
        "--no-basins",
    ]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    for part in ["plicp", "WSM (thesis)", "base (the guess)", "not published", "matchers.md"] {
        assert!(ran.out.contains(part), "{part:?} missing in {}", ran.out);
    }
    let expected = [
        "accuracy.csv",
        "error-time.png",
        "errors.png",
        "matchers.csv",
        "matchers.md",
        "metrics.json",
        "scans.png",
    ];
    assert_eq!(names(&target), expected);
    let csv = read_to_string(target.join("matchers.csv")).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let cell = |row: &[&str]| row[2].contains('/');
    assert_eq!(rows.iter().filter(|row| cell(row)).count(), 9, "{csv}");
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let trials: usize =
        rows.iter().filter(|r| cell(r)).map(|r| r[3].parse::<usize>().unwrap()).sum();
    assert_eq!(trials, 85);
    // From the truth itself a matcher finds the lobby's pose to some millimetres.
    assert!(rows[1][4].parse::<f64>().unwrap() < 0.01, "{csv}");
}

#[test]
fn the_figures_are_the_same_on_any_number_of_threads() {
    let figures = |threads: &str| {
        let ran = run(args![
            "bench",
            "matchers",
            "--repeats",
            "1",
            "--matcher",
            "vgicp",
            "--situation",
            "wood",
            "--situation",
            "rooms",
            "--rooms",
            "5",
            "--json",
            "--threads",
            threads,
        ]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let timeless = |line: &&str| !line.contains("time_ms");
        ran.out.lines().filter(timeless).map(str::to_owned).collect::<Vec<_>>()
    };
    let one = figures("1");
    assert!(one.iter().any(|line| line.contains("translation_efficiency")));
    assert_eq!(one, figures("2"));
}

#[test]
fn unknown_names_are_refused() {
    for arguments in [["--matcher", "best"], ["--situation", "sea"], ["--repeats", "0"]] {
        let ran = run(args!["bench", "matchers", arguments[0], arguments[1]]);
        assert_eq!(ran.code, 2, "{}", ran.err);
    }
    let ran = run(args!["bench", "matchers", "--truth", "1,2,3"]);
    assert_eq!(ran.code, 2, "{}", ran.err);
}

#[test]
fn one_s_own_scans_and_logs_are_compared() {
    let scratch = Scratch::new("bench-own");
    let log = scratch.file("walk.clf", short_log());
    let name = |number: usize| format!("{}:{number}", log.display());
    let start =
        ["bench", "matchers", "--matcher", "plicp", "--matcher", "gicp", "--matcher", "vgicp"];
    let with = |more: &[std::ffi::OsString]| {
        run(start.iter().map(std::ffi::OsString::from).chain(more.iter().cloned()))
    };
    let ran = with(&args!["--scans", name(10), name(11)]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("walk:10 - walk:11"), "{}", ran.out);
    let ran = with(&args!["--scans", name(10), name(1000)]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("no 1000th"), "{}", ran.err);
    let ran = with(&args!["--scans", name(10), scratch.at("missing.clf")]);
    assert_eq!(ran.code, 1);
    let ran = with(&args!["--log", &log, "--pairs", "10"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.out.contains("agreement on 10 pairs"), "{}", ran.out);
}
