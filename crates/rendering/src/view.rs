use geometry::{Pose2, Vector2};
use sensing::Scan;

/// A scan and where its laser stood in the map.
#[derive(Clone, Copy, Debug)]
pub struct ScanView<'a> {
    /// The laser's pose in the map frame.
    pub map_from_laser: Pose2,
    /// What it saw.
    pub scan: &'a Scan,
}

impl ScanView<'_> {
    /// The points that were hit, in the map frame and in beam order.
    pub fn hits(&self) -> impl Iterator<Item = Vector2<f64>> {
        let origin = self.map_from_laser;
        (0..self.scan.len()).filter_map(move |i| {
            let range = f64::from(self.scan.hit(i)?);
            let (s, c) = (origin.yaw + self.scan.laser().bearing(i)).sin_cos();
            Some(Vector2::new(origin.x + range * c, origin.y + range * s))
        })
    }
}
