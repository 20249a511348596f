use crate::{Ran, Scratch, args, run, short_log};
use std::path::Path;

/// Maps a log and checks that nothing but what was there and, on success, the result is left.
fn map(scratch: &Scratch, log: impl AsRef<Path>) -> Ran {
    let before = scratch.names();
    let ran = run(args!["map", log.as_ref(), "-o", scratch.at("out")]);
    let whole = scratch.at("out/metrics.json").exists();
    assert_eq!(whole, ran.code != 1, "exit code {}: {}", ran.code, ran.err);
    let _ = std::fs::remove_dir_all(scratch.at("out"));
    assert_eq!(scratch.names(), before, "something is left behind");
    ran
}

#[test]
fn logs_without_scans_fail_with_a_reason() {
    let scratch = Scratch::new("empty");
    for (name, content, message) in [
        ("empty.clf", &b""[..], "none of its 0 lines is a laser message"),
        ("odometry.clf", b"ODOM 0 0 0 0 0 0 1 h 0\n", "none of its 1 lines"),
        ("binary.clf", &[0, 159, 146, 150, 10, 7, 8, 200, 10, 99], "line 1, field 1: not a CARMEN"),
        ("beamless.clf", b"FLASER 0 0 0 0 0 0 0 1.0 h 0\n", "a scan without beams"),
        ("broken.bz2", b"BZh91AY&SYgarbage garbage garbage", "reading stopped here"),
        ("cut.clf", b"FLASER 3 1.0 2", "the file ends in the middle"),
    ] {
        let log = scratch.file(name, content);
        let ran = map(&scratch, &log);
        assert_eq!(ran.code, 1, "{name}");
        for part in [message, name] {
            assert!(ran.err.contains(part), "{name}: {part:?} missing in {}", ran.err);
        }
    }
}

#[test]
fn missing_logs_and_unwritable_places_show_before_any_work() {
    let scratch = Scratch::new("missing");
    let missing = scratch.at("missing.clf");
    let ran = map(&scratch, &missing);
    assert!(ran.code == 1 && ran.err.contains("missing.clf"), "{}", ran.err);
    let ran = map(&scratch, &scratch.0);
    assert!(ran.code == 1 && ran.err.contains("folder"), "{}", ran.err);

    let log = scratch.file("good.clf", short_log());
    std::fs::create_dir(scratch.at("mine")).unwrap();
    scratch.file("mine/diary.txt", "dear diary");
    for (place, message) in [
        ("good.clf", "not a folder"),
        ("good.clf/out", "cannot create"),
        ("mine", "choose another folder"),
    ] {
        let ran = run(args!["map", &log, "-o", scratch.at(place)]);
        assert!(ran.code == 1 && ran.err.contains(message), "{place}: {}", ran.err);
    }
    assert_eq!(std::fs::read(scratch.at("mine/diary.txt")).unwrap(), b"dear diary");
    assert_eq!(scratch.names(), ["good.clf", "mine"]);
}

#[test]
fn what_can_be_used_is_used_and_the_rest_is_told() {
    let scratch = Scratch::new("lossy");
    let good = short_log();
    let lines: Vec<&str> = good.lines().collect();
    let scan = |edit: &dyn Fn(&mut Vec<String>)| {
        let mut fields: Vec<String> = lines[60].split(' ').map(str::to_owned).collect();
        edit(&mut fields);
        fields.join(" ")
    };
    let long = format!("FLASER 9 {}", "1 ".repeat(60_000));
    for (name, line, lost) in [
        ("nan", scan(&|f| f[2..40].fill("nan".into())), None),
        ("infinite", scan(&|f| f[2..40].fill("inf".into())), None),
        ("negative", scan(&|f| f[2..40].fill("-3.5".into())), None),
        ("mostly-nan", scan(&|f| f[2..180].fill("NaN".into())), Some("beams are valid")),
        (
            "fewer-beams",
            scan(&|f| {
                f[1] = "91".into();
                f.drain(2..92);
            }),
            None,
        ),
        (
            "missing-beam",
            scan(&|f| {
                f.remove(7);
            }),
            Some("181 beams announced"),
        ),
        (
            "nan-pose",
            scan(&|f| {
                let n = f.len();
                f[n - 4] = "nan".into();
            }),
            Some("not finite"),
        ),
        ("word", scan(&|f| f[9] = "oops".into()), Some("field 10: not a number")),
        ("long", long, Some("longer than 65536 bytes")),
        ("binary", "\u{0}\u{1}\u{2}garbage".into(), Some("not a CARMEN message")),
    ] {
        let mut edited = lines.clone();
        edited.insert(61, &line);
        let log = scratch.file(&format!("{name}.clf"), edited.join("\n") + "\n");
        let ran = map(&scratch, &log);
        assert_eq!(ran.code, if lost.is_some() { 3 } else { 0 }, "{name}: {}{}", ran.out, ran.err);
        if let Some(lost) = lost {
            assert!(ran.out.contains("line 62") && ran.out.contains(lost), "{name}: {}", ran.out);
        }
    }
    let cut = scratch.file("cut.clf", &good[..good.len() - 200]);
    let ran = map(&scratch, &cut);
    assert!(ran.code == 3 && ran.out.contains("ends in the middle"), "{}", ran.out);
}
