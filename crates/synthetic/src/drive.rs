use geometry::{LieGroup, Pose2, Vector2, Vector3, wrap_angle};

/// How a robot follows waypoints: straight at each in turn, slowing down where it must turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Top speed, m/s.
    pub speed: f64,
    /// Top turn rate, rad/s.
    pub turn_rate: f64,
    /// Scans per second.
    pub scan_rate: f64,
}

impl Default for Drive {
    fn default() -> Self {
        Drive { speed: 0.6, turn_rate: 1.0, scan_rate: 3.0 }
    }
}

impl Drive {
    /// A waypoint counts as reached within this distance, metres.
    const ARRIVAL: f64 = 0.25;
    /// Simulation step, seconds.
    const STEP: f64 = 0.01;
    /// A robot that would drive longer than this is stopped, seconds.
    const LONGEST: f64 = 36_000.0;

    /// The true poses at which scans are taken, world frame. The robot starts at the first waypoint
    /// and looks at the second.
    pub fn poses(&self, waypoints: &[(f64, f64)]) -> Vec<Pose2> {
        let points: Vec<_> = waypoints.iter().map(|&(x, y)| Vector2::new(x, y)).collect();
        let (Some(first), Some(second)) = (points.first(), points.get(1)) else {
            return points.iter().map(|p| Pose2::new(p.x, p.y, 0.0)).collect();
        };
        let ahead = second - first;
        let mut pose = Pose2::new(first.x, first.y, ahead.y.atan2(ahead.x));
        let mut poses = vec![pose];
        let (mut time, mut next) = (0.0, 1);
        while next < points.len() && time < Self::LONGEST {
            let to_goal = points[next] - pose.translation();
            if to_goal.norm() < Self::ARRIVAL {
                next += 1;
                continue;
            }
            pose = self.advance(&pose, to_goal);
            time += Self::STEP;
            if time * self.scan_rate >= poses.len() as f64 {
                poses.push(pose);
            }
        }
        poses
    }

    /// One simulation step towards a goal given relative to the robot's position.
    fn advance(&self, pose: &Pose2, to_goal: Vector2<f64>) -> Pose2 {
        let error = wrap_angle(to_goal.y.atan2(to_goal.x) - pose.yaw);
        let turn = (2.5 * error).clamp(-self.turn_rate, self.turn_rate);
        let speed = self.speed * (1.0 - error.abs() / 0.6).max(0.0);
        pose.retract(&Vector3::new(speed * Self::STEP, 0.0, turn * Self::STEP))
    }
}
