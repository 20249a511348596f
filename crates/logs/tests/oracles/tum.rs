use geometry::Pose2;
use manifoldslam_logs::{DropReason, LogError, TumPose, read_tum, write_tum};
use proptest::prelude::*;
use std::path::Path;

fn parse(text: &str) -> Result<Vec<TumPose>, LogError> {
    read_tum(text.as_bytes(), Path::new("some.tum"))
}

proptest! {
    #[test]
    fn what_is_written_is_read_back(
        poses in prop::collection::vec(
            ("[0-9]{1,9}\\.[0-9]{1,6}", -1e4f64..1e4, -1e4f64..1e4, -3.1f64..3.1), 0..40,
        ),
    ) {
        let written = poses.iter().map(|(s, x, y, yaw)| (s.as_str(), Pose2::new(*x, *y, *yaw)));
        let mut text = Vec::new();
        write_tum(&mut text, written).unwrap();
        let read = read_tum(&text[..], Path::new("some.tum")).unwrap();
        prop_assert_eq!(read.len(), poses.len());
        for (got, (stamp, x, y, yaw)) in read.iter().zip(&poses) {
            prop_assert_eq!(&got.stamp_text, stamp);
            prop_assert!(got.pose.distance(&Pose2::new(*x, *y, 0.0)) < 1e-8);
            prop_assert!(geometry::wrap_angle(got.pose.yaw - yaw).abs() < 1e-9);
        }
    }
}

#[test]
fn both_formats_comments_and_tilted_poses_are_read() {
    let text = "# stamp x y z qx qy qz qw\n\n1.50 1 2 9 0 0 0.70710678 0.70710678 # note\n2 1 2 0.5\r\n\
        3,1,2,0,0,0,2,2\n4 1 2 3 0.1 0.1 0.6 0.6\n";
    let poses = parse(text).unwrap();
    let stamps: Vec<_> = poses.iter().map(|p| p.stamp_text.as_str()).collect();
    assert_eq!(stamps, ["1.50", "2", "3", "4"]);
    let quarter = std::f64::consts::FRAC_PI_2;
    assert!((poses[0].pose.yaw - quarter).abs() < 1e-7);
    assert_eq!(poses[1].pose, Pose2::new(1.0, 2.0, 0.5));
    assert!((poses[2].pose.yaw - quarter).abs() < 1e-12);
    assert!(poses[3].pose.yaw > 1.4 && poses[3].pose.yaw < 1.7);
}

#[test]
fn faults_are_named_with_file_line_and_field() {
    let long = "1".repeat(5000);
    for (bad, field, reason) in [
        ("1.0 2 3", Some(4), DropReason::MissingField),
        ("1.0 2 3 4 5 6 7", Some(8), DropReason::MissingField),
        ("1.0 2 3 4 5 6 7 8 9", Some(9), DropReason::ExtraField),
        ("x 2 3 4", Some(1), DropReason::NotANumber),
        ("1.0 2 y 4", Some(3), DropReason::NotANumber),
        ("1.0 nan 3 4", Some(2), DropReason::NotFinite),
        ("1.0 1 2 0 0 0 0 0", Some(5), DropReason::NotFinite),
        (long.as_str(), None, DropReason::TooLong { limit: 4096 }),
    ] {
        let error = parse(&format!("1.0 2 3 4\n{bad}\n")).unwrap_err();
        let LogError::Line { line, .. } = &error else { panic!("{error}") };
        assert_eq!((line.line, line.field, &line.reason), (2, field, &reason), "{bad:.20}");
        assert!(error.to_string().starts_with("some.tum:2"), "{error}");
    }
}

#[test]
fn a_half_turn_and_zero_are_written_plainly() {
    let mut text = Vec::new();
    write_tum(&mut text, [("1.0", Pose2::new(-0.0, 0.0, -0.0))]).unwrap();
    let line = String::from_utf8(text).unwrap();
    assert_eq!(line, "1.0 0.000000000 0.000000000 0 0 0 0.000000000000 1.000000000000\n");
}
