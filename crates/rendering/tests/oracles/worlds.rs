//! Small worlds whose scans are known exactly.

use geometry::Pose2;
use manifoldslam_rendering::{
    CastSettings, GridFrame, HitMissCounts, OccupancyGrid, OccupancyRule, ScanView,
};
use sensing::{LaserModel, Scan};

/// A whole circle of `beams` beams.
pub fn full_circle(beams: u32) -> LaserModel {
    LaserModel {
        beams,
        angle_min_rad: -std::f64::consts::PI,
        angle_increment_rad: std::f64::consts::TAU / f64::from(beams),
        ..LaserModel::half_circle(beams)
    }
}

/// Distance from inside the square |x|, |y| <= `half` to its wall.
pub fn square_range(pose: &Pose2, bearing: f64, half: f64) -> f64 {
    let (s, c) = (pose.yaw + bearing).sin_cos();
    let along = |position: f64, direction: f64| {
        if direction == 0.0 {
            f64::INFINITY
        } else {
            (half.copysign(direction) - position) / direction
        }
    };
    along(pose.x, c).min(along(pose.y, s))
}

/// A scan of the square room from `pose`.
pub fn square_scan(pose: &Pose2, laser: LaserModel, half: f64) -> Scan {
    let range = |i: usize| square_range(pose, laser.bearing(i), half) as f32;
    Scan::classify(laser, &(0..laser.beams as usize).map(range).collect::<Vec<_>>())
}

/// Poses inside the unit-scaled room.
pub fn poses_in_square(half: f64) -> Vec<Pose2> {
    let spots = [(0.1, -0.2), (0.5, 0.4), (-0.6, 0.3), (-0.3, -0.7), (0.7, -0.5)];
    spots.iter().enumerate().map(|(k, (x, y))| Pose2::new(x * half, y * half, k as f64)).collect()
}

/// A recorded run: its scans and where the laser really stood.
pub fn recorded(seed: u64) -> (Vec<Scan>, Vec<Pose2>) {
    let run = synthetic::two_loop_building(seed);
    let lasers =
        run.truth.iter().zip(&run.observations).map(|(t, o)| *t * o.base_from_laser).collect();
    (run.observations.into_iter().map(|o| o.scan).collect(), lasers)
}

/// Scans with their poses.
pub fn views<'a>(scans: &'a [Scan], poses: &[Pose2]) -> Vec<ScanView<'a>> {
    scans.iter().zip(poses).map(|(scan, &pose)| ScanView { map_from_laser: pose, scan }).collect()
}

/// Counts with default settings.
pub fn cast(frame: GridFrame, views: &[ScanView]) -> HitMissCounts {
    HitMissCounts::cast(frame, views, &CastSettings::default()).expect("finite poses")
}

/// A decided grid with default settings.
pub fn grid(frame: GridFrame, views: &[ScanView]) -> OccupancyGrid {
    OccupancyGrid::decide(&cast(frame, views), &OccupancyRule::default())
}

/// Runs `work` on its own pool.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(work)
}
