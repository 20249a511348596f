use crate::worlds::{
    cast, full_circle, poses_in_square, recorded, square_range, square_scan, views, with_threads,
};
use geometry::{Pose2, Vector2};
use manifoldslam_rendering::{CastSettings, GridFrame, HitMissCounts, RenderError, ScanView};
use sensing::{LaserModel, Scan};

/// Powers of two, so that shifting by whole cells is exact.
const RESOLUTION: f64 = 1.0 / 32.0;

fn square(low: f64, high: f64) -> GridFrame {
    GridFrame::covering(Vector2::repeat(low), Vector2::repeat(high), RESOLUTION).expect("a frame")
}

/// Against the beam model itself, cell by cell: a cell well inside a room is looked through by
/// every scan, one well outside by none, and hits lie on the walls only.
#[test]
fn every_scan_sees_all_of_an_empty_room() {
    let (half, poses) = (3.0, poses_in_square(3.0));
    let scans: Vec<Scan> = poses.iter().map(|p| square_scan(p, full_circle(720), half)).collect();
    let frame = square(-4.0, 4.0);
    let counts = cast(frame, &views(&scans, &poses));
    for row in 0..frame.height {
        for column in 0..frame.width {
            let center = frame.center(column, row);
            let depth = half - center.amax();
            let misses = usize::from(counts.misses(column, row));
            if depth > 2.0 * RESOLUTION {
                assert_eq!(misses, scans.len(), "{center}");
            }
            if depth < -RESOLUTION {
                assert_eq!(misses, 0, "{center}");
            }
            if counts.hits(column, row) > 0 {
                assert!(depth.abs() <= RESOLUTION, "{center} is no wall");
            }
        }
    }
}

/// Away from borders of the free area, a narrow beam decides the cells it covers: compare with the
/// range of the nearest beam, in a half circle of beams with jumps, dropouts and garbage.
#[test]
fn cells_follow_their_nearest_beam() {
    let laser = LaserModel::half_circle(181);
    let ranges: Vec<f32> = (0..181)
        .map(|i| match i % 20 {
            0..6 => 2.0,
            6..12 => 5.0,
            12 | 13 => f32::NAN,
            14 => 0.0,
            _ => 80.0,
        })
        .collect();
    let scan = Scan::classify(laser, &ranges);
    let pose = Pose2::new(0.3, -0.2, 0.4);
    let settings = CastSettings { no_return_clear_m: 3.0, ..CastSettings::default() };
    let frame = square(-7.0, 7.0);
    let views = [ScanView { map_from_laser: pose, scan: &scan }];
    let counts = HitMissCounts::cast(frame, &views, &settings).expect("finite");
    let mut checked = 0;
    for (column, row) in (0..frame.height).flat_map(|r| (0..frame.width).map(move |c| (c, r))) {
        let p = pose.inverse().transform(frame.center(column, row));
        let (range, bearing) = (p.norm(), p.y.atan2(p.x));
        let beam = ((bearing - laser.angle_min_rad) / laser.angle_increment_rad).round();
        if !(0.0..181.0).contains(&beam) || range < 0.5 {
            continue;
        }
        let clear = match beam as usize % 20 {
            0..6 => 2.0,
            6..12 => 5.0,
            12..15 => 0.0,
            _ => 3.0,
        };
        let aside = (bearing - laser.bearing(beam as usize)).abs() / laser.angle_increment_rad;
        if (range - clear).abs() > 2.0 * RESOLUTION && aside < 0.4 {
            let expected = u16::from(range < clear);
            assert_eq!(counts.misses(column, row), expected, "beam {beam} at {range} m");
            checked += 1;
        }
    }
    assert!(checked > 20_000, "{checked}");
}

#[test]
fn no_return_clears_only_the_safe_distance_and_garbage_nothing() {
    let laser = LaserModel::half_circle(181);
    let pose = Pose2::IDENTITY;
    let frame = square(-6.0, 6.0);
    let seen_through = |range: f32, safe: f64| {
        let scan = Scan::classify(laser, &[range; 181]);
        let settings = CastSettings { no_return_clear_m: safe, ..CastSettings::default() };
        let view = ScanView { map_from_laser: pose, scan: &scan };
        let counts = HitMissCounts::cast(frame, &[view], &settings).expect("finite");
        let mut farthest: f64 = 0.0;
        for (c, r) in (0..frame.height).flat_map(|r| (0..frame.width).map(move |c| (c, r))) {
            assert_eq!(counts.hits(c, r), 0);
            if counts.misses(c, r) > 0 {
                farthest = farthest.max(frame.center(c, r).norm());
            }
        }
        farthest
    };
    assert!((seen_through(81.83, 3.0) - 3.0).abs() < 2.0 * RESOLUTION);
    assert!((seen_through(f32::INFINITY, 1.5) - 1.5).abs() < 2.0 * RESOLUTION);
    for garbage in [f32::NAN, -1.0, 0.01] {
        assert_eq!(seen_through(garbage, 3.0), 0.0);
    }
}

/// A dark spot on a wall 1.5 m away does not let one look through the wall; a wide gap does.
#[test]
fn dropouts_clear_no_farther_than_their_neighbours() {
    let laser = LaserModel::half_circle(181);
    let frame = square(-4.0, 4.0);
    for (gap, expected) in [(1, 0), (5, 0), (6, 1), (20, 1)] {
        let mut ranges = [1.5; 181];
        ranges[90 - gap / 2..90 - gap / 2 + gap].fill(80.0);
        let scan = Scan::classify(laser, &ranges);
        let counts = cast(frame, &[ScanView { map_from_laser: Pose2::IDENTITY, scan: &scan }]);
        let cell = frame.cells_from_map(Vector2::new(2.5, 0.0));
        assert_eq!(counts.misses(cell.x as usize, cell.y as usize), expected, "{gap} beams");
    }
}

#[test]
fn counts_do_not_depend_on_threads_or_order() {
    let (scans, poses) = recorded(3);
    let mut views = views(&scans, &poses);
    let frame = GridFrame::around(&views, 0.5, 0.05).expect("a frame");
    let one = with_threads(1, || cast(frame, &views));
    let three = with_threads(3, || cast(frame, &views));
    assert!(one == three);
    views.reverse();
    assert!(one == with_threads(2, || cast(frame, &views)));
}

#[test]
fn shifting_by_whole_cells_shifts_the_counts() {
    let (half, poses) = (3.0, poses_in_square(3.0));
    let scans: Vec<Scan> = poses.iter().map(|p| square_scan(p, full_circle(360), half)).collect();
    let counts = cast(square(-4.0, 4.0), &views(&scans, &poses));
    let shift = |p: &Pose2| Pose2::new(p.x + 64.0, p.y + 64.0, p.yaw);
    let shifted: Vec<Pose2> = poses.iter().map(shift).collect();
    // Rounding of the poses themselves is below 1e-14 m; no border of this scene lies so near a
    // centre.
    let moved = cast(square(60.0, 68.0), &views(&scans, &shifted));
    for row in 0..counts.frame().height {
        for c in 0..counts.frame().width {
            assert_eq!(counts.hits(c, row), moved.hits(c, row));
            assert_eq!(counts.misses(c, row), moved.misses(c, row));
        }
    }
}

/// Clipping: a crop counts exactly what the whole counts there.
#[test]
fn a_crop_equals_the_whole() {
    let (scans, poses) = recorded(5);
    let views = views(&scans, &poses);
    let whole = cast(GridFrame::around(&views, 1.0, RESOLUTION).expect("a frame"), &views);
    let (left, bottom) = (201, 117);
    let corner = whole.frame().origin + Vector2::new(left as f64, bottom as f64) * RESOLUTION;
    let size = Vector2::new(251.0, 190.0) * RESOLUTION;
    let frame = GridFrame::covering(corner, corner + size, RESOLUTION).expect("a frame");
    assert_eq!((frame.width, frame.height), (251, 190));
    let crop = cast(frame, &views);
    let mut seen = 0;
    for row in 0..frame.height {
        for c in 0..frame.width {
            assert_eq!(crop.hits(c, row), whole.hits(c + left, row + bottom), "{c} {row}");
            assert_eq!(crop.misses(c, row), whole.misses(c + left, row + bottom), "{c} {row}");
            seen += u32::from(crop.hits(c, row) > 0);
        }
    }
    assert!(seen > 200, "the crop shows walls: {seen}");
}

/// More scans than a 16-bit sum can hold are counted in parts and saturate.
#[test]
fn counts_saturate() {
    let scan = Scan::classify(LaserModel::half_circle(3), &[1.0, 1.0, 1.0]);
    let view = ScanView { map_from_laser: Pose2::IDENTITY, scan: &scan };
    let frame = GridFrame::covering(Vector2::repeat(-1.5), Vector2::repeat(1.5), 0.5).expect("ok");
    let counts = cast(frame, &vec![view; 70_000]);
    let most = (0..6).map(|c| counts.hits(c, 3)).max();
    assert_eq!(most, Some(u16::MAX));
}

#[test]
fn bad_input_is_refused() {
    let origin = Vector2::zeros();
    let far = Vector2::repeat(1e6);
    for resolution in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = GridFrame::covering(origin, far, resolution);
        assert!(matches!(error, Err(RenderError::Resolution { .. })));
    }
    assert!(matches!(GridFrame::covering(origin, far, 0.01), Err(RenderError::TooLarge { .. })));
    let nan = GridFrame::covering(origin, Vector2::repeat(f64::NAN), 0.1);
    assert!(matches!(nan, Err(RenderError::NotFinite { .. })));
    assert_eq!(GridFrame::around(&[], 1.0, 0.1), Err(RenderError::Empty));
    let scan = Scan::classify(LaserModel::half_circle(1), &[1.0]);
    let lost = Pose2 { x: f64::NAN, ..Pose2::IDENTITY };
    let views = [ScanView { map_from_laser: lost, scan: &scan }];
    assert!(matches!(GridFrame::around(&views, 1.0, 0.1), Err(RenderError::NotFinite { .. })));
}

#[test]
fn stray_hits_do_not_stretch_the_frame() {
    let (half, pose) = (3.0, Pose2::IDENTITY);
    let mut scans = vec![square_scan(&pose, full_circle(720), half); 30];
    let mut ranges: Vec<f32> = vec![f32::NAN; 720];
    ranges[100] = 39.0;
    scans.push(Scan::classify(full_circle(720), &ranges));
    let poses = vec![pose; scans.len()];
    let frame = GridFrame::around(&views(&scans, &poses), 0.0, 0.05).expect("a frame");
    assert!(square_range(&pose, 0.0, half) == half);
    let size = frame.upper_right() - frame.origin;
    assert!(size.max() <= 7.1, "{size}");
}
