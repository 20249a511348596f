use crate::read;
use geometry::{Matrix2, Pose2, Vector2};
use manifoldslam_logs::{CarmenReader, DropReason, LandmarkTable, LogRecord, ReadOptions};
use proptest::prelude::*;
use sensing::{LandmarkKind, Sighting};
use std::path::Path;

fn scan(odom: Pose2, stamp: f64) -> String {
    let pose = format!("{} {} {}", odom.x, odom.y, odom.yaw);
    format!("FLASER 3 1.0 2.0 {stamp} {pose} {pose} {stamp} host 0\n")
}

#[test]
fn a_landmark_line_means_what_its_fields_say() {
    let text = format!(
        "{}LANDMARK tag 7b 1.5 -0.5 0.01 0.002 0.04 1 2 0.5 1.25 host 0\n\
         LANDMARK robot red 3 0 0.01 0 0.01 0.75 0.09 1 2 0.5 1.25 host 0\n\
         LANDMARK victim - 3 0 0.01 0 0.01 1 2 0.5 1.25 host 0\n{}",
        scan(Pose2::new(1.0, 2.0, 0.5), 1.0),
        scan(Pose2::new(1.0, 2.0, 0.5), 1.25),
    );
    let (records, report) = read(text);
    assert!(records[0].observation.sightings.is_empty(), "they go with the scan that follows");
    let [tag, robot, victim] = &records[1].observation.sightings[..] else { panic!() };
    let expected = Sighting {
        kind: LandmarkKind::Tag,
        id: Some("7b".into()),
        position: Vector2::new(1.5, -0.5),
        covariance: Matrix2::new(0.01, 0.002, 0.002, 0.04),
        yaw: None,
    };
    assert_eq!(*tag, expected);
    assert_eq!((robot.kind, robot.yaw), (LandmarkKind::Robot, Some((0.75, 0.09))));
    assert_eq!((victim.kind, victim.id.clone()), (LandmarkKind::Victim, None));
    assert_eq!(report.sightings, 3);
    assert!(!report.is_lossy());
}

#[test]
fn bad_landmarks_are_refused_with_field_and_reason() {
    use DropReason::{BadCovariance, BadId, MissingField, NotANumber, NotFinite, UnknownLandmark};
    let tail = "0 0 0 1 host 0";
    for (body, field, reason) in [
        ("ghost 7 1 1 0.01 0 0.01", Some(2), UnknownLandmark),
        ("robot - 1 1 0.01 0 0.01", Some(3), BadId),
        ("tag 7 x 1 0.01 0 0.01", Some(4), NotANumber),
        ("tag 7 nan 1 0.01 0 0.01", Some(8), NotFinite),
        ("tag 7 1 1e9 0.01 0 0.01", Some(8), NotFinite),
        ("tag 7 1 1 0.01 0.02 0.01", Some(8), BadCovariance),
        ("tag 7 1 1 0 0 0.01", Some(8), BadCovariance),
        ("tag 7 1 1 inf 0 0.01", Some(8), BadCovariance),
        ("robot a 1 1 0.01 0 0.01 0.5 -1", Some(10), BadCovariance),
        ("tag 7 1 1 0.01 0", None, MissingField),
    ] {
        let text = format!("LANDMARK {body} {tail}\n{}", scan(Pose2::IDENTITY, 2.0));
        let (records, report) = read(text);
        assert!(records[0].observation.sightings.is_empty(), "{body}");
        let [dropped] = &report.dropped[..] else { panic!("{body}: {:?}", report.dropped) };
        assert_eq!((dropped.line, dropped.field, &dropped.reason), (1, field, &reason), "{body}");
    }
}

#[test]
fn a_landmark_after_the_last_scan_is_told() {
    let text =
        format!("{}LANDMARK tag 7 1 1 0.1 0 0.1 0 0 0 2 host 0\n", scan(Pose2::IDENTITY, 1.0));
    let (_, report) = read(text);
    assert_eq!((report.sightings, report.dropped_count), (0, 1));
    assert_eq!((report.dropped[0].line, &report.dropped[0].reason), (2, &DropReason::NoScan));
}

/// Records of a log with a table beside it, and the table's report.
fn with_table(log: &str, table: &str) -> (Vec<LogRecord>, manifoldslam_logs::TableReport) {
    let mut table = LandmarkTable::read(table.as_bytes(), Path::new("t.csv")).unwrap();
    let mut records: Vec<_> = CarmenReader::new(log.as_bytes(), ReadOptions::default()).collect();
    records.iter_mut().for_each(|record| table.give(record));
    (records, table.finish())
}

#[test]
fn a_table_says_the_same_in_all_its_ways() {
    let log = scan(Pose2::IDENTITY, 1.0) + &scan(Pose2::new(0.5, 0.0, 0.0), 2.0);
    let (range, bearing) = (2.0f64, 0.5f64);
    let at = Vector2::new(range * bearing.cos(), range * bearing.sin());
    for table in [
        format!("stamp,kind,id,x_m,y_m,std_m\n2,tag,7,{},{},0.1\n", at.x, at.y),
        format!(
            "id,kind,note,stamp,cov_yy_m2,cov_xy_m2,cov_xx_m2,x_m,y_m\r\n\
             7, tag ,far away,2,0.01,0,0.01,{},{}\r\n",
            at.x, at.y
        ),
        format!(
            "# by hand\nstamp,kind,id,range_m,bearing_rad,range_std_m,bearing_std_rad\n\
             2,tag,7,{range},{bearing},0.1,0.05\n"
        ),
    ] {
        let (records, report) = with_table(&log, &table);
        assert_eq!((report.sightings, report.dropped_count), (1, 0), "{table}");
        let [seen] = &records[1].observation.sightings[..] else { panic!("{table}") };
        assert_eq!((seen.kind, seen.id.as_deref()), (LandmarkKind::Tag, Some("7")));
        assert!((seen.position - at).norm() < 1e-9, "{table}");
        assert!((seen.covariance - Matrix2::identity() * 0.01).norm() < 1e-9, "{table}");
    }
}

#[test]
fn a_table_tells_what_is_wrong_with_it() {
    let log = scan(Pose2::IDENTITY, 1.0) + &scan(Pose2::IDENTITY, 50.0);
    let table = "stamp,kind,id,x_m,y_m,std_m\n1,tag,7,1,1,0.1\nx,tag,7,1,1,0.1\n\
                 1,ghost,7,1,1,0.1\n1,tag,7,1,,0.1\n1,tag,7,1,1,0\n20,tag,7,1,1,0.1\n\
                 60,tag,7,1,1,0.1\n";
    let (_, report) = with_table(&log, table);
    assert_eq!((report.sightings, report.dropped_count), (1, 6));
    let told: Vec<_> = report.dropped.iter().map(|d| (d.line, d.field)).collect();
    assert_eq!(told, [(3, Some(1)), (4, Some(2)), (5, None), (6, None), (7, None), (8, None)]);
    for header in ["", "stamp,kind,x_m,y_m", "stamp,x_m,y_m,std_m", "a,b\n1,2"] {
        let header = format!("{header}\n");
        let read = LandmarkTable::read(header.as_bytes(), Path::new("t.csv"));
        assert_eq!(read.is_err(), header.trim() != "", "{header}");
    }
}

proptest! {
    /// However the robot drives between sighting and scan, the landmark stays where it is.
    #[test]
    fn a_landmark_does_not_move_with_the_robot(
        x in -5.0..5.0f64, y in -5.0..5.0f64, yaw in -3.0..3.0f64, share in 0.01..0.99f64,
    ) {
        use geometry::LieGroup;
        let (start, end) = (Pose2::new(1.0, -2.0, 0.3), Pose2::new(x, y, yaw));
        let seen_at = start.compose(&Pose2::exp(&(start.between(&end).log() * share)));
        let place = Vector2::new(3.0, 4.0);
        let local = seen_at.inverse().transform(place);
        let stamp = 1.0 + share;
        let line = format!(
            "LANDMARK tag 7 {} {} 0.01 0 0.01 {} {} {} {stamp} host 0\n",
            local.x, local.y, seen_at.x, seen_at.y, seen_at.yaw
        );
        let (records, _) = read(scan(start, 1.0) + &line + &scan(end, 2.0));
        let table = format!("stamp,kind,id,x_m,y_m,std_m\n{stamp},tag,7,{},{},0.1\n", local.x, local.y);
        let (tabled, _) = with_table(&(scan(start, 1.0) + &scan(end, 2.0)), &table);
        for log in [&records, &tabled] {
            let seen = &log[1].observation.sightings[0];
            prop_assert!((end.transform(seen.position) - place).norm() < 1e-4);
            prop_assert!(seen.covariance.trace() >= 0.02 - 1e-12, "doubt never shrinks");
        }
    }
}
