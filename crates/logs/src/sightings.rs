use geometry::{Matrix2, Matrix3, Pose2, Vector3, wrap_angle};
use nalgebra::Matrix2x3;
use sensing::{LandmarkKind, Sighting};

/// Odometry over the moment between a sighting and a scan errs by this share of the way and of the
/// turn: twice what wheels do on average, to be safe.
const ODOMETRY_ERROR: f64 = 0.1;
/// A robot moves at most so fast between a sighting and a scan: where its motion is not known, and
/// another's that was seen; m/s.
const SPEED_M_PER_SEC: f64 = 0.5;
/// Longer moments count as so long, seconds.
const LONGEST_SECS: f64 = 60.0;

/// A sighting carried over to where the next scan was taken.
///
/// `scan_from_sighting` is the base at the sighting seen from the base at the scan, by odometry;
/// `None` without it: the robot is then taken as standing, with a doubt that grows with time.
pub(crate) fn carry_over(
    sighting: &Sighting,
    scan_from_sighting: Option<Pose2>,
    secs: f64,
) -> Sighting {
    let moved = (secs.abs().min(LONGEST_SECS) * SPEED_M_PER_SEC).powi(2);
    let pose = scan_from_sighting.unwrap_or(Pose2::IDENTITY);
    let doubt = match scan_from_sighting {
        Some(pose) => {
            let way = (ODOMETRY_ERROR * pose.norm()).powi(2);
            Matrix3::from_diagonal(&Vector3::new(way, way, (ODOMETRY_ERROR * pose.yaw).powi(2)))
        }
        None => Matrix3::from_diagonal(&Vector3::new(moved, moved, 0.0)),
    };
    let (s, c) = pose.yaw.sin_cos();
    let rotation = Matrix2::new(c, -s, s, c);
    let quarter = rotation * geometry::Vector2::new(-sighting.position.y, sighting.position.x);
    let jacobian = Matrix2x3::new(c, -s, quarter.x, s, c, quarter.y);
    let mut covariance = rotation * sighting.covariance * rotation.transpose()
        + jacobian * doubt * jacobian.transpose();
    if sighting.kind == LandmarkKind::Robot {
        covariance += Matrix2::identity() * moved;
    }
    let turned = |(yaw, variance)| (wrap_angle(pose.yaw + yaw), variance + doubt[(2, 2)]);
    Sighting {
        kind: sighting.kind,
        id: sighting.id.clone(),
        position: pose.transform(sighting.position),
        covariance,
        yaw: sighting.yaw.map(turned),
    }
}
