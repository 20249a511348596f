//! What the tests share: clouds of synthetic rooms.

use geometry::Pose2;
use manifoldslam_matching::{PointCloud, PointCloudSettings};
use sensing::Scan;
use synthetic::{LaserNoise, RoomPair, Scanner, noisy_room_pair};

pub fn cloud(scan: &Scan) -> PointCloud {
    PointCloud::from_scan(scan, &Pose2::IDENTITY, &PointCloudSettings::default())
}

/// 361 beams over half a circle, 15 mm of range noise: the comparison data of the literature table.
pub fn scanner() -> Scanner {
    Scanner::half_circle(361, LaserNoise::gaussian(0.015))
}

/// Two scans `distance` metres and `yaw_deg` degrees apart.
pub fn pair(seed: u64, distance: f64, yaw_deg: f64) -> RoomPair {
    noisy_room_pair(seed, &scanner(), distance, yaw_deg.to_radians())
}
