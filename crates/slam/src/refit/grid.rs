use geometry::Pose2;

/// Relative poses at fixed steps, far finer than poses are known.
///
/// What is measured from a place on a grid stays the same while the map moves by less than that
/// tells, so that it need not be measured again; and it is the same whether it is or not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Between places along either axis, metres.
    pub step_m: f64,
    /// Between turns, radians.
    pub step_rad: f64,
}

/// A place on a grid, in steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GridPose {
    x: i32,
    y: i32,
    yaw: i32,
}

impl Grid {
    /// A grid of so many metres, and of turns that move what is 10 m away as far.
    pub const fn of(step_m: f64) -> Self {
        Grid { step_m, step_rad: 0.1 * step_m }
    }

    /// The place nearest to a pose, of at most two thousand million steps.
    pub fn nearest(&self, pose: &Pose2) -> GridPose {
        let steps = |value: f64, step: f64| (value / step).round() as i32;
        let [x, y] = [pose.x, pose.y].map(|value| steps(value, self.step_m));
        GridPose { x, y, yaw: steps(pose.yaw, self.step_rad) }
    }

    /// The pose at a place.
    pub fn pose(&self, place: GridPose) -> Pose2 {
        let [x, y] = [place.x, place.y].map(|steps| f64::from(steps) * self.step_m);
        Pose2::new(x, y, f64::from(place.yaw) * self.step_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_place_is_within_half_a_step_and_its_own_nearest() {
        let grid = Grid::of(2e-3);
        for k in 0..1000 {
            let wave = |rate: f64| (rate * f64::from(k)).sin();
            let pose = Pose2::new(12.0 * wave(1.3), 12.0 * wave(0.7), 3.1 * wave(2.1));
            let place = grid.nearest(&pose);
            let off = pose.coordinates() - grid.pose(place).coordinates();
            let turn = geometry::wrap_angle(off.z);
            assert!(off.x.abs().max(off.y.abs()) < 0.5001 * grid.step_m, "{pose:?}");
            assert!(turn.abs() < 0.5001 * grid.step_rad, "{pose:?}");
            assert_eq!(grid.nearest(&grid.pose(place)), place);
        }
    }
}
