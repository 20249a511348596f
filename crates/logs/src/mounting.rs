use geometry::{Pose2, wrap_angle};

/// A laser is not mounted farther from the robot's centre than this, metres.
const MAX_LEVER_M: f64 = 3.0;
/// Offsets agree within this, metres and radians.
const TOLERANCE_M: f64 = 0.02;
const TOLERANCE_RAD: f64 = 0.02;
/// Share of the lines that must agree.
const MIN_SHARE: f64 = 0.9;

/// `base_from_laser` from lines that tell where the laser and the base are, both in the odometry
/// frame.
///
/// A mounting is rigid: the offsets of all lines agree up to the rounding of the text. In logs that
/// a mapping program has rewritten, the first pose is its *estimate* of the laser's pose; such
/// offsets drift, and the answer is `None`.
pub(crate) fn rigid_mounting(odom_poses: &[(Pose2, Pose2)]) -> Option<Pose2> {
    let offsets: Vec<Pose2> = odom_poses.iter().map(|(laser, base)| base.between(laser)).collect();
    let first = offsets.first()?;
    let x = median(offsets.iter().map(|o| o.x));
    let y = median(offsets.iter().map(|o| o.y));
    let yaw = first.yaw + median(offsets.iter().map(|o| wrap_angle(o.yaw - first.yaw)));
    let mounting = Pose2::new(round(x), round(y), round(yaw));
    let agree = offsets.iter().filter(|o| {
        o.distance(&mounting) <= TOLERANCE_M
            && wrap_angle(o.yaw - mounting.yaw).abs() <= TOLERANCE_RAD
    });
    let rigid = agree.count() as f64 >= MIN_SHARE * offsets.len() as f64;
    (rigid && mounting.norm() <= MAX_LEVER_M).then_some(mounting)
}

/// Poses in logs have six decimals; their differences are good to five.
fn round(value: f64) -> f64 {
    (value * 1e5).round() * 1e-5
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(count: usize) -> impl Iterator<Item = Pose2> {
        (0..count).map(|i| Pose2::new(i as f64 * 0.1, (i as f64 * 0.3).sin(), i as f64 * 0.05))
    }

    #[test]
    fn a_rigid_offset_is_found_through_rounding() {
        let truth = Pose2::new(0.21, -0.03, 0.4);
        let cut = |v: f64| (v * 1e6).round() * 1e-6;
        let cut = |p: Pose2| Pose2::new(cut(p.x), cut(p.y), cut(p.yaw));
        let poses: Vec<_> = path(200).map(|base| (cut(base * truth), cut(base))).collect();
        let found = rigid_mounting(&poses).unwrap();
        assert!(found.distance(&truth) < 1e-5 && (found.yaw - truth.yaw).abs() < 1e-5);
    }

    #[test]
    fn a_laser_that_looks_backwards_survives_the_wrap() {
        let poses: Vec<_> = path(50)
            .map(|base| (base * Pose2::new(-0.2, 0.0, std::f64::consts::PI), base))
            .collect();
        let found = rigid_mounting(&poses).unwrap();
        assert!((found.yaw.abs() - std::f64::consts::PI).abs() < 1e-4);
        assert!((found.x + 0.2).abs() < 1e-9);
    }

    #[test]
    fn corrected_poses_are_no_mounting() {
        let drift = Pose2::new(0.01, 0.0, 0.002);
        let mut odometry = Pose2::IDENTITY;
        let poses: Vec<_> = path(200)
            .map(|estimate| {
                odometry = odometry * drift;
                (estimate, estimate * odometry)
            })
            .collect();
        assert_eq!(rigid_mounting(&poses), None);
        assert_eq!(rigid_mounting(&[]), None);
    }
}
