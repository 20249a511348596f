use crate::OdometrySettings;
use crate::track::ScanRecord;
use geometry::{GaussianPose2, Pose2};
use sensing::Observation;

/// Odometry that moves farther than this between two scans jumps, metres and radians: nothing
/// confirms it where nothing was seen.
const JUMP_M: f64 = 1.0;
const JUMP_RAD: f64 = 1.0;

/// The motion by odometry from the first of some scans, past the others, to a new observation;
/// `None` where it is missing or jumps.
pub(crate) fn bridge(
    scans: &[ScanRecord],
    observation: &Observation,
    settings: &OdometrySettings,
) -> Option<GaussianPose2> {
    let readings = scans.iter().map(|scan| scan.odom_from_base);
    let readings: Vec<Pose2> =
        readings.chain([observation.odom_from_base]).collect::<Option<_>>()?;
    let (first, last) = (readings.first()?, readings.last()?);
    let (mut distance_m, mut turn_rad) = (0.0, 0.0);
    for pair in readings.windows(2) {
        let step = pair[0].between(&pair[1]);
        if step.norm() > JUMP_M || step.yaw.abs() > JUMP_RAD {
            return None;
        }
        distance_m += step.norm();
        turn_rad += step.yaw.abs();
    }
    Some(settings.gaussian_along(first.between(last), distance_m, turn_rad))
}
