use crate::{read, read_with};
use geometry::Pose2;
use manifoldslam_logs::{DropReason, ReadOptions};
use sensing::{BeamClass, LaserLimits, RobotId, Stamp, Twist};
use std::f64::consts::PI;
use std::fmt::Write;

fn close(a: Pose2, b: Pose2) -> bool {
    a.distance(&b) < 1e-4 && geometry::wrap_angle(a.yaw - b.yaw).abs() < 1e-4
}

fn pose_text(pose: Pose2) -> String {
    format!("{:.6} {:.6} {:.6}", pose.x, pose.y, pose.yaw)
}

/// A drive through the plane.
fn drive(count: usize) -> Vec<Pose2> {
    (0..count).map(|i| Pose2::new(0.05 * i as f64, 1.0, 0.02 * i as f64)).collect()
}

#[test]
fn an_old_laser_line_means_what_its_fields_say() {
    let text = "# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp\n\
        PARAM robot_frontlaser_offset 9.0 nohost 0\n\
        ODOM 1 2 0.5 0.3 -0.1 0 976052857.337284 nohost 0.000000\r\n\
        \n\
        FLASER 4 1.07 81.83 0.01 nan 1.1 2 0.5  1 2 0.5 976052857.337530 nohost 0.000246\n\
        SYNC tag 1 nohost 0\n";
    let (records, report) =
        read_with(text, ReadOptions { robot: RobotId(3), ..Default::default() });
    let [record] = &records[..] else { panic!("{records:?}") };
    assert_eq!(record.line, 5);
    assert_eq!(record.stamp_text, "976052857.337530");
    let seen = &record.observation;
    assert_eq!(seen.robot, RobotId(3));
    assert_eq!(seen.stamp, Stamp(976_052_857_337_530_000));
    assert_eq!(seen.odom_from_base, Some(Pose2::new(1.0, 2.0, 0.5)));
    let expected = Pose2::new(0.1 * 0.5f64.cos(), -0.1 * 0.5f64.sin(), 0.0);
    assert!(close(seen.base_from_laser, expected), "{:?}", seen.base_from_laser);
    let classes: Vec<_> = (0..4).map(|i| seen.scan.class(i)).collect();
    use BeamClass::{Hit, Invalid, NoReturn, TooClose};
    assert_eq!(classes, [Hit, NoReturn, TooClose, Invalid]);
    assert_eq!(seen.scan.hit(0), Some(1.07));
    assert_eq!(record.twist, Some(Twist { forward_m_per_sec: 0.3, yaw_rad_per_sec: -0.1 }));
    assert_eq!((report.lines, report.scans, report.invalid_beams), (6, 1, 1));
    assert_eq!(report.skipped.get("SYNC"), Some(&1));
    assert!(!report.is_lossy());
}

#[test]
fn a_robot_laser_line_means_what_its_fields_say() {
    let head = "ROBOTLASER1 0 -1.000000 2.000000 0.500000 8.000000 0.010000 0 5 \
                1 2 3 8.0 7.991";
    let poses = "1.3 2 0.5  1 2 0.5";
    for (name, remissions, tail) in [
        ("remissions and turn axis", "5 9 9 9 9 9", "0.5 -0.25 0.3 0.2 1000000.0"),
        ("no remissions", "0", "0.5 -0.25 0.3 0.2 1000000.0"),
        ("no turn axis", "0", "0.5 -0.25 0.3 0.2"),
        ("early version", "", "0.5 -0.25 0.3 0.2"),
        ("early version with turn axis", "", "0.5 -0.25 0.3 0.2 1000000.0"),
    ] {
        let text = format!("{head} {remissions} {poses} {tail} 1232658478.161285 pc 0.1\n");
        let (records, report) = read(&text);
        let [record] = &records[..] else { panic!("{name}: {report:?}") };
        let seen = &record.observation;
        assert_eq!(record.stamp_text, "1232658478.161285", "{name}");
        assert_eq!(seen.odom_from_base, Some(Pose2::new(1.0, 2.0, 0.5)));
        let expected = Pose2::new(0.3 * 0.5f64.cos(), -0.3 * 0.5f64.sin(), 0.0);
        assert!(close(seen.base_from_laser, expected), "{name}: {:?}", seen.base_from_laser);
        assert_eq!(record.twist, Some(Twist { forward_m_per_sec: 0.5, yaw_rad_per_sec: -0.25 }));
        let laser = seen.scan.laser();
        assert_eq!((laser.angle_min_rad, laser.angle_increment_rad, laser.beams), (-1.0, 0.5, 5));
        assert!((laser.range_max_m - 7.992).abs() < 1e-5);
        assert_eq!((seen.scan.hit_count(), seen.scan.class(3)), (4, BeamClass::NoReturn));
    }
}

/// The scanner of a `ROBOTLASER` line of 181 beams: first bearing and step, degrees.
fn described(start: f64, fov: f64, resolution: f64) -> (f64, f64) {
    let ranges = "1.0 ".repeat(181);
    let text = format!(
        "ROBOTLASER1 0 {start} {fov} {resolution} 80 0.01 0 181 {ranges} 0 0 0 0 0 0 0 0 0 0 0 0 1.0 h 0\n"
    );
    let (records, _) = read(text);
    let laser = *records[0].observation.scan.laser();
    let round = |rad: f64| (rad.to_degrees() * 1e3).round() / 1e3;
    (round(laser.angle_min_rad), round(laser.angle_increment_rad))
}

#[test]
fn nonsense_in_the_description_gives_way_to_sense() {
    assert_eq!(described(-PI / 2.0, PI, PI / 180.0), (-90.0, 1.0));
    assert_eq!(described(-PI / 2.0, PI, 0.0), (-90.0, 1.0), "resolution missing");
    assert_eq!(described(-PI / 2.0, PI, PI / 90.0), (-90.0, 1.0), "resolution against view");
    assert_eq!(described(-PI / 2.0, 0.0, PI / 180.0), (-90.0, 1.0), "view missing");
    assert_eq!(described(PI / 2.0, PI, -PI / 180.0), (90.0, -1.0), "upside down");
    assert_eq!(described(-90.0, 180.0, 1.0), (-90.0, 1.0), "degrees");
    assert_eq!(described(f64::NAN, PI, 0.1), (-90.0, 1.0), "not a number");
}

#[test]
fn old_lines_get_the_scanner_their_count_belongs_to() {
    for (beams, first_deg, last_deg) in [
        (180, -90.0, 89.0),
        (181, -90.0, 90.0),
        (360, -90.0, 89.5),
        (361, -90.0, 90.0),
        (401, -50.0, 50.0),
        (400, -50.0, 49.75),
        (541, -135.0, 135.0),
        (1081, -135.0, 135.0),
        (682, -119.707, 119.707),
    ] {
        let text = format!("FLASER {beams} {} 0 0 0 0 0 0 1.5 h 0\n", "2.5 ".repeat(beams));
        let (records, _) = read(text);
        let laser = records[0].observation.scan.laser();
        let bearing = |i| laser.bearing(i).to_degrees();
        assert!((bearing(0) - first_deg).abs() < 1e-3, "{beams}: {}", bearing(0));
        assert!((bearing(beams - 1) - last_deg).abs() < 1e-3, "{beams}: {}", bearing(beams - 1));
    }
}

#[test]
fn mountings_come_from_the_lines() {
    let front = Pose2::new(0.2, 0.01, 0.02);
    let rear = Pose2::new(-0.25, 0.0, PI);
    let mut text = String::new();
    for (i, base) in drive(60).into_iter().enumerate() {
        let (f, r, b) = (pose_text(base * front), pose_text(base * rear), pose_text(base));
        writeln!(text, "FLASER 2 1.0 2.{i} {f} {b} {i}.5 h 0").unwrap();
        writeln!(text, "RLASER 2 3.0 4.{i} {r} {b} {i}.5 h 0").unwrap();
    }
    let (records, report) = read(text);
    assert_eq!(records.len(), 120, "{report:?}");
    for (i, record) in records.iter().enumerate() {
        let expected = if i % 2 == 0 { front } else { rear };
        let found = record.observation.base_from_laser;
        assert!(close(found, expected), "{i}: {found:?}");
    }
}

#[test]
fn a_rear_laser_looks_backwards_even_where_the_line_forgets() {
    let text = "RLASER 2 1.0 2.0 0.8 0 0 1 0 0 1.5 h 0\n";
    let found = read(text).0[0].observation.base_from_laser;
    assert!(close(found, Pose2::new(-0.2, 0.0, PI)), "{found:?}");
}

#[test]
fn drifting_offsets_are_estimates_and_parameters_stand_in() {
    let mut text = String::from(
        "PARAM robot_frontlaser_offset 0.21 nohost 0\nPARAM robot_rearlaser_offset -0.3 nohost 0\n",
    );
    for (i, base) in drive(60).into_iter().enumerate() {
        let corrected = pose_text(Pose2::new(0.01, 0.0, 0.005 * i as f64) * base);
        let base = pose_text(base);
        writeln!(text, "FLASER 2 1.0 2.{i} {corrected} {base} {i}.5 h 0").unwrap();
        writeln!(text, "RLASER 2 3.0 4.{i} {corrected} {base} {i}.5 h 0").unwrap();
    }
    let (records, _) = read(text);
    assert_eq!(records[0].observation.base_from_laser, Pose2::new(0.21, 0.0, 0.0));
    assert_eq!(records[1].observation.base_from_laser, Pose2::new(-0.3, 0.0, PI));
    assert_eq!(records[118].observation.base_from_laser, Pose2::new(0.21, 0.0, 0.0));
}

#[test]
fn the_order_of_the_file_is_kept_and_stamps_verbatim() {
    let stamps = ["5.10", "4.0900", "4.09", "7", "1e1", "3.000000001"];
    let text: String = stamps
        .iter()
        .enumerate()
        .map(|(i, s)| format!("FLASER 1 1.{i} 0 0 0 0 0 0 {s} h 0\n"))
        .collect();
    let (records, report) = read(text);
    let found: Vec<_> = records.iter().map(|r| r.stamp_text.as_str()).collect();
    assert_eq!(found, stamps);
    assert_eq!(report.stamps_back, 2);
    assert!(!report.is_lossy(), "a jumping clock loses nothing");
}

#[test]
fn odometry_can_be_missing_or_switched_off() {
    let still = "FLASER 1 1.0 0 0 0 0 0 0 1.0 h 0\nFLASER 1 1.1 0 0 0 0 0 0 2.0 h 0\n";
    assert!(read(still).0.iter().all(|r| r.observation.odom_from_base.is_none()));
    let moving = "FLASER 1 1.0 0 0 0 0 0 0 1.0 h 0\nFLASER 1 1.1 1 0 0 1 0 0 2.0 h 0\n";
    assert!(read(moving).0.iter().all(|r| r.observation.odom_from_base.is_some()));
    let off = ReadOptions { use_odometry: false, ..Default::default() };
    assert!(read_with(moving, off).0.iter().all(|r| r.observation.odom_from_base.is_none()));
}

#[test]
fn one_scan_told_in_two_formats_counts_once() {
    let text = "FLASER 2 1.0 2.0 0 0 0 0 0 0 1.0 h 0\n\
        ROBOTLASER1 0 -1 2 2 80 0.01 0 2 1.0 2.0 0 0 0 0 0 0 0 0 0 0 0 0 1.0 h 0\n\
        FLASER 2 1.0 2.0 0 0 0 0 0 0 1.1 h 0\n";
    let (records, report) = read(text);
    assert_eq!((records.len(), report.duplicates), (2, 1));
}

#[test]
fn a_no_return_code_is_learned_from_the_log() {
    let mut text = String::new();
    for i in 0..300 {
        let ranges: Vec<_> = (0..180)
            .map(|k| {
                if k % 9 == i % 9 { "8.00".into() } else { format!("{:.2}", 1.0 + k as f64 / 40.0) }
            })
            .collect();
        writeln!(text, "FLASER 180 {} 0 0 0 0 0 0 {i}.5 h 0", ranges.join(" ")).unwrap();
    }
    let (records, _) = read(&text);
    assert!(records.iter().all(|r| (r.observation.scan.hit_count()) == 160));
    let limits = LaserLimits { detect_no_return: false, ..Default::default() };
    let (records, _) = read_with(&text, ReadOptions { limits, ..Default::default() });
    assert!(records.iter().all(|r| (r.observation.scan.hit_count()) == 180));
}

#[test]
fn bad_lines_are_dropped_with_line_field_and_reason() {
    let good = "FLASER 2 1.0 2.0 0 0 0 0 0 0 1.0 h 0";
    let nan = f64::NAN;
    let cases = [
        ("FLASER 0 0 0 0 0 0 0 1.0 h 0".into(), Some(2), DropReason::NoBeams),
        ("FLASER x 1 0 0 0 0 0 0 1.0 h 0".into(), Some(2), DropReason::NotANumber),
        ("FLASER".into(), Some(2), DropReason::MissingField),
        (
            "FLASER 3 1.0 2.0 0 0 0 0 0 0 1.0 h 0".into(),
            Some(12),
            DropReason::BeamCount { announced: 3, fields: 11 },
        ),
        ("FLASER 18446744073709551615 1.0".into(), Some(2), DropReason::NotANumber),
        (
            "FLASER 9000000000000000000 1.0 2.0".into(),
            Some(2),
            DropReason::BeamCount { announced: 9_000_000_000_000_000_000, fields: 2 },
        ),
        ("FLASER 2 1.0 2,0 0 0 0 0 0 0 1.0 h 0".into(), Some(4), DropReason::NotANumber),
        (format!("FLASER 1 1.0 {nan} 0 0 0 0 0 1.0 h 0"), Some(4), DropReason::NotFinite),
        ("FLASER 1 1.0 0 0 0 0 1e99 0 1.0 h 0".into(), Some(8), DropReason::NotFinite),
        ("FLASER 1 1.0 0 0 0 0 0 0 never h 0".into(), Some(10), DropReason::NotANumber),
        (
            "FLASER 4 nan nan -1 nan 0 0 0 0 0 0 1.0 h 0".into(),
            None,
            DropReason::TooFewValidBeams { valid: 0, beams: 4 },
        ),
        ("ODOM 1 2".into(), Some(4), DropReason::MissingField),
        ("\u{7f}ELF\u{1}\u{2}".into(), Some(1), DropReason::NotAMessage),
        ("flaser 1 2 3".into(), Some(1), DropReason::NotAMessage),
        ("x".repeat(100_000), None, DropReason::TooLong { limit: 65536 }),
        (
            "ROBOTLASER1 0 -1 2 1 80 0.01 0 2 1 2 7 0 0 0 0 0 0 0 0 0 0 0 1.0 h 0".into(),
            Some(11),
            DropReason::BeamCount { announced: 2, fields: 17 },
        ),
    ];
    for (bad, field, reason) in cases {
        let (records, report) = read(format!("{good}\n{bad}\n{good}\n"));
        let name: String = bad.chars().take(60).collect();
        assert_eq!(records.len(), 2, "{name}");
        assert_eq!(report.dropped_count, 1, "{name}");
        let dropped = &report.dropped[0];
        assert_eq!((dropped.line, dropped.field, &dropped.reason), (2, field, &reason), "{name}");
        assert!(report.is_lossy());
        assert!(dropped.to_string().starts_with("line 2"));
    }
}

#[test]
fn beam_counts_may_change_and_bad_beams_leave_the_scan() {
    let text = "FLASER 2 1.0 2.0 0 0 0 0 0 0 1.0 h 0\n\
        FLASER 3 1.0 nan inf 0 0 0 0 0 0 2.0 h 0\n\
        FLASER 1 -1 0 0 0 0 0 0 2.5 h 0\n\
        FLASER 1 4.0 0 0 0 0 0 0 3.0 h 0\n";
    let (records, report) = read(text);
    let beams: Vec<_> = records.iter().map(|r| r.observation.scan.len()).collect();
    assert_eq!(beams, [2, 3, 1]);
    assert_eq!((report.invalid_beams, report.dropped_count), (1, 1));
}

#[test]
fn the_list_of_dropped_lines_is_bounded() {
    let (records, report) = read("?\n".repeat(5000));
    assert!(records.is_empty());
    assert_eq!((report.dropped.len(), report.dropped_count), (100, 5000));
    let names: String = (0..5000).map(|i| format!("NAME{i} 1\n")).collect();
    let (_, report) = read(names);
    assert!(report.skipped.len() <= 65);
    assert_eq!(report.skipped.values().sum::<u64>(), 5000);
}
