use crate::read;
use manifoldslam_logs::{Cut, DropReason, Piece, ReadOptions};
use sensing::Attitude;

fn scan(stamp: &str) -> String {
    format!("FLASER 3 1.0 2.0 3.0 0 0 0 0 0 0 {stamp} host 0\n")
}

fn attitudes(text: &str) -> Vec<Option<Attitude>> {
    read(text).0.iter().map(|record| record.observation.attitude).collect()
}

#[test]
fn a_scan_has_the_attitude_told_last_if_that_still_holds() {
    let text = scan("99.9")
        + "ATTITUDE 0.5 0.5 99.95 host 0\n"
        + "ATTITUDE -0.25 0.125 100.0 host 0\n"
        + &scan("100.1")
        + &scan("100.4")
        + &scan("100.6")
        + "ATTITUDE 0 -3 100.65 host 0\n"
        + &scan("100.7").replacen("3.0", "3.1", 1);
    let leaning = Some(Attitude { roll_rad: -0.25, pitch_rad: 0.125 });
    let last = Some(Attitude { roll_rad: 0.0, pitch_rad: -3.0 });
    assert_eq!(attitudes(&text), [None, leaning, leaning, None, last]);
    assert!(!read(&text).1.is_lossy());
}

#[test]
fn what_is_no_attitude_is_dropped_and_told() {
    for (line, field, reason) in [
        ("ATTITUDE 0.1 91.5 100 host 0", Some(3), DropReason::NotAnAngle),
        ("ATTITUDE nan 0.1 100 host 0", Some(2), DropReason::NotAnAngle),
        ("ATTITUDE 0.1 x 100 host 0", Some(3), DropReason::NotANumber),
        ("ATTITUDE 0.1 0.2", Some(4), DropReason::MissingField),
        ("ATTITUDE 0.1 0.2 0.3 100 host 0", None, DropReason::ExtraField),
    ] {
        let (records, report) = read(format!("{line}\n{}", scan("100.1")));
        assert_eq!(records[0].observation.attitude, None, "{line}");
        let [dropped] = &report.dropped[..] else { panic!("{line}: {:?}", report.dropped) };
        assert_eq!((dropped.line, dropped.field), (1, field), "{line}");
        assert_eq!(dropped.reason, reason, "{line}");
    }
    let cut_off = read(scan("100") + "ATTITUDE 0.1 0.2 10").1;
    assert_eq!(cut_off.dropped[0].reason, DropReason::Truncated);
}

#[test]
fn a_piece_of_a_log_keeps_its_attitudes() {
    let text: String = (0..6)
        .map(|i| format!("ATTITUDE 0.{i} 0.1 10{i}.0 host 0\n") + &scan(&format!("10{i}.0")))
        .map(|text| text.replacen("1.0 2.0", "1.5 2.0", 1))
        .collect();
    let (records, report) = read(&text);
    let scan_lines: Vec<u64> = records.iter().map(|record| record.line).collect();
    let piece = Piece { scans: 2..5, piece_from_odom: geometry::Pose2::new(1.0, 2.0, 0.5) };
    let cut = Cut {
        pieces: &[piece],
        scan_lines: &scan_lines,
        lines: report.lines,
        alternate: false,
        line_limit: ReadOptions::default().line_limit,
    };
    let mut written = String::new();
    cut.run(text.as_bytes(), |_, line| {
        written += std::str::from_utf8(line).unwrap();
        Ok(())
    })
    .unwrap();
    assert_eq!(attitudes(&written), attitudes(&text)[2..5]);
    assert!(attitudes(&written).iter().all(Option::is_some));
}
