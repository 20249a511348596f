use geometry::Pose2;

/// Poses are on the grid at every so many metres, ...
const STEP_M: f64 = 1e-3;
/// ... and every so many radians: what moves a surface 10 m away by a millimetre.
const STEP_RAD: f64 = 1e-4;

/// A relative pose on a fixed grid, far finer than poses are known.
///
/// What is measured from here does not change when the map moves by less than it can tell, so that
/// it need not be measured again, and is the same whether it is or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GridPose {
    x: i32,
    y: i32,
    yaw: i32,
}

impl GridPose {
    /// The place on the grid that is nearest to a pose, of less than a thousand kilometres.
    pub fn nearest(pose: &Pose2) -> Self {
        let steps = |value: f64, step: f64| (value / step).round() as i32;
        let [x, y] = [pose.x, pose.y].map(|value| steps(value, STEP_M));
        GridPose { x, y, yaw: steps(pose.yaw, STEP_RAD) }
    }

    /// The pose there.
    pub fn pose(self) -> Pose2 {
        let [x, y] = [self.x, self.y].map(|steps| f64::from(steps) * STEP_M);
        Pose2::new(x, y, f64::from(self.yaw) * STEP_RAD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn the_nearest_place_is_within_half_a_step_and_its_own_nearest() {
        for k in 0..1000 {
            let wave = |rate: f64| (rate * f64::from(k)).sin();
            let pose = Pose2::new(12.0 * wave(1.3), 12.0 * wave(0.7), PI * wave(2.1));
            let place = GridPose::nearest(&pose);
            let off = pose.coordinates() - place.pose().coordinates();
            let turn = geometry::wrap_angle(off.z);
            assert!(off.x.abs().max(off.y.abs()) < 0.5001 * STEP_M, "{pose:?}");
            assert!(turn.abs() < 0.5001 * STEP_RAD, "{pose:?}");
            assert_eq!(GridPose::nearest(&place.pose()), place);
        }
    }
}
