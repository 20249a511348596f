use crate::read;
use geometry::Pose2;
use manifoldslam_logs::{Cut, CutReport, LogRecord, Piece, ReadOptions, shares};

/// A log of `scans` scans with everything that may stand between them; odometry in a bend.
fn log(scans: usize) -> String {
    let mut text = String::from("# a log\nPARAM robot_frontlaser_offset 0.25\n\n");
    for i in 0..scans {
        let t = i as f64;
        let (x, y, yaw) = (40.0 + 0.3 * t, 7.0 * (0.1 * t).sin(), 0.2 * t - 3.0);
        let (lx, ly) = (x + 0.25 * yaw.cos(), y + 0.25 * yaw.sin());
        text += &format!("ODOM {x:.6} {y:.6} {yaw:.6} 0.5 0.1 0 {i}.5 host {i}.5\n");
        text += &format!("TRUEPOS {x:.6} {y:.6} {yaw:.6} {x:.6} {y:.6} {yaw:.6} {i}.5 host 0\n");
        text += "NMEA-GGA 47.1 8.2\n";
        let poses = format!("{lx:.6} {ly:.6} {yaw:.6} {x:.6}  {y:.6}\t{yaw:.6}");
        let name = if i % 3 == 2 { "ROBOTLASER1 0 -1.57 3.14 1.57 50 0.01 0" } else { "FLASER" };
        let rest = if i % 3 == 2 { " 0.5 0.1 0 0 0" } else { "" };
        text += &format!("{name} 3 {}.25 2.5 81.83", i % 9 + 1);
        text += if i % 3 == 2 { " 2 77 78 " } else { " " };
        text += &format!("{poses}{rest} 97605{i}.1234567{} host 0.1\n", "0".repeat(i % 4));
        if i % 5 == 4 {
            text += "FLASER 3 1.0 broken\n";
        }
    }
    text
}

fn cut(text: &str, pieces: &[Piece], alternate: bool) -> (Vec<String>, CutReport) {
    let (records, report) = read(text);
    let scan_lines: Vec<u64> = records.iter().map(|record| record.line).collect();
    let line_limit = ReadOptions::default().line_limit;
    let cut = Cut { pieces, scan_lines: &scan_lines, lines: report.lines, alternate, line_limit };
    let mut texts = vec![String::new(); pieces.len()];
    let report = cut.run(text.as_bytes(), |piece, line| {
        texts[piece] += std::str::from_utf8(line).unwrap();
        Ok(())
    });
    (texts, report.unwrap())
}

fn pieces(scans: usize, count: usize, overlap: f64) -> Vec<Piece> {
    let frame = |k: usize| Pose2::new(31.0 * k as f64 - 50.0, -17.3, 1.1 * k as f64 + 0.4);
    let shares = shares(scans, count, overlap);
    let piece = |(k, scans)| Piece { scans, piece_from_odom: frame(k) };
    shares.into_iter().enumerate().map(piece).collect()
}

/// Scans, stamps and mounting are the log's; odometry differs by the piece's motion alone.
fn assert_same_scans(piece: &Piece, got: &[LogRecord], expected: &[&LogRecord]) {
    assert_eq!(got.len(), expected.len());
    for (a, b) in got.iter().zip(expected) {
        assert_eq!((&a.stamp_text, a.twist), (&b.stamp_text, b.twist));
        let (a, b) = (&a.observation, &b.observation);
        assert_eq!((&a.scan, a.stamp), (&b.scan, b.stamp));
        let moved = piece.piece_from_odom * b.odom_from_base.unwrap();
        let off = moved.between(&a.odom_from_base.unwrap());
        assert!(off.norm() < 1e-8 && off.yaw.abs() < 1e-8, "{off:?}");
        assert!(a.base_from_laser.between(&b.base_from_laser).norm() < 1e-5);
    }
}

#[test]
fn pieces_hold_their_scans_in_frames_of_their_own() {
    let text = log(60);
    let (records, _) = read(&text);
    for (count, overlap) in [(1, 0.0), (2, 0.15), (3, 0.0), (6, 0.5), (7, 0.9)] {
        let pieces = pieces(60, count, overlap);
        let (texts, report) = cut(&text, &pieces, false);
        assert_eq!(report.left_out.get("NMEA-GGA"), Some(&60));
        for ((piece, text), scans) in pieces.iter().zip(&texts).zip(&report.scans) {
            let (got, read) = read(text);
            let expected: Vec<_> = records[piece.scans.clone()].iter().collect();
            assert_same_scans(piece, &got, &expected);
            assert_eq!((*scans, read.dropped_count), (got.len(), 0));
            assert!(text.starts_with("# a log\nPARAM robot_frontlaser_offset 0.25\n"));
            assert_eq!(text.matches("ODOM").count(), got.len());
        }
        let held = pieces.iter().flat_map(|p| p.scans.clone());
        assert_eq!(held.collect::<std::collections::BTreeSet<_>>().len(), 60);
    }
}

#[test]
fn poses_of_all_messages_move_with_the_piece() {
    let text = log(9);
    let pieces = pieces(9, 3, 0.0);
    let (texts, _) = cut(&text, &pieces, false);
    for (piece, cut) in pieces.iter().zip(&texts) {
        let first = piece.scans.start as f64;
        let (x, y, yaw) = (40.0 + 0.3 * first, 7.0 * (0.1 * first).sin(), 0.2 * first - 3.0);
        let expected = piece.piece_from_odom * Pose2::new(x, y, yaw);
        for (name, at) in [("ODOM", vec![1]), ("TRUEPOS", vec![1, 4])] {
            let line = cut.lines().find(|l| l.starts_with(name)).unwrap();
            let field = |i: usize| line.split(' ').nth(i).unwrap().parse::<f64>().unwrap();
            for i in at {
                let pose = Pose2::new(field(i), field(i + 1), field(i + 2));
                assert!(expected.between(&pose).norm() < 2e-6, "{line}");
                assert!(expected.between(&pose).yaw.abs() < 2e-6, "{line}");
            }
        }
    }
}

#[test]
fn dealt_in_turn_every_scan_is_in_one_piece() {
    let text = log(50);
    let (records, _) = read(&text);
    let pieces = pieces(50, 3, 0.3);
    let (texts, _) = cut(&text, &pieces, true);
    let mut stamps: Vec<String> = Vec::new();
    for (piece, text) in pieces.iter().zip(&texts) {
        let (got, _) = read(text);
        // Neighbours' scans of the overlap alternate.
        assert!(got.len() < piece.scans.len() && got.len() > piece.scans.len() / 2);
        stamps.extend(got.into_iter().map(|record| record.stamp_text));
    }
    let mut all: Vec<_> = records.into_iter().map(|record| record.stamp_text).collect();
    stamps.sort();
    all.sort();
    assert_eq!(stamps, all);
}

#[test]
fn the_identity_leaves_lines_as_they_are() {
    let text = log(12);
    let piece = Piece { scans: 0..12, piece_from_odom: Pose2::IDENTITY };
    let (texts, _) = cut(&text, &[piece], false);
    let kept: Vec<_> = text
        .lines()
        .filter(|l| !l.is_empty() && !l.starts_with("NMEA") && !l.contains("broken"))
        .collect();
    assert_eq!(texts[0].lines().collect::<Vec<_>>(), kept);
}

#[test]
fn landmarks_go_with_their_scan_and_stay_where_they_are() {
    let mut text = String::new();
    for i in 0..12 {
        let pose = format!("{} 2.0 {}", 0.5 * f64::from(i), 0.1 * f64::from(i));
        let before = format!("{} 2.0 {}", 0.5 * f64::from(i) - 0.1, 0.1 * f64::from(i) - 0.02);
        let tail = format!("{before} {i}.75 host 0");
        text += &format!("LANDMARK tag {i} 1.5 -0.5 0.01 0 0.01 {tail}\n");
        text += &format!("LANDMARK robot red 3 0.2 0.01 0 0.01 0.7 0.05 {tail}\n");
        text += &format!("FLASER 3 {i}.25 2.5 1.5 {pose} {pose} {}.0 host 0\n", i + 1);
    }
    let (records, _) = read(&text);
    let pieces = pieces(12, 3, 0.25);
    let (texts, _) = cut(&text, &pieces, false);
    for (piece, text) in pieces.iter().zip(&texts) {
        let (got, report) = read(text);
        assert_eq!(report.sightings, 2 * piece.scans.len() as u64);
        for (a, b) in got.iter().zip(&records[piece.scans.clone()]) {
            for (a, b) in a.observation.sightings.iter().zip(&b.observation.sightings) {
                assert_eq!((a.kind, &a.id), (b.kind, &b.id));
                assert!((a.position - b.position).norm() < 1e-7);
            }
        }
    }
}
