use crate::{Drive, FloorPlan, RayCaster, Scanner, WheelNoise};
use geometry::Pose2;
use rand::{SeedableRng, rngs::StdRng};
use sensing::{Observation, RobotId, Stamp};

/// A robot: how it drives, what it sees with, how its wheels count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot {
    /// Driving.
    pub drive: Drive,
    /// Seeing.
    pub scanner: Scanner,
    /// Counting.
    pub wheels: WheelNoise,
}

/// A recorded log with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The world it was recorded in.
    pub plan: FloorPlan,
    /// True base pose of every observation, world frame.
    pub truth: Vec<Pose2>,
    /// What the robot recorded; as many as there are true poses.
    pub observations: Vec<Observation>,
}

impl Run {
    /// Stamp of the first scan: 1000 s, so that logs do not begin at zero.
    const START_NANOS: i64 = 1_000_000_000_000;
    /// Robots of a team begin this long after each other: 10 h, the longest drive.
    const APART_NANOS: i64 = 36_000_000_000_000;

    /// Drives a robot along waypoints through a plan. Stamps are whole microseconds.
    pub fn record(plan: FloorPlan, robot: &Robot, waypoints: &[(f64, f64)], seed: u64) -> Run {
        Run::record_in(&RayCaster::new(plan), robot, waypoints, seed)
    }

    /// [`Run::record`] in a world that several robots share.
    pub fn record_in(world: &RayCaster, robot: &Robot, waypoints: &[(f64, f64)], seed: u64) -> Run {
        let truth = robot.drive.poses(waypoints);
        // Separate sources, so that changing one noise leaves the other's samples alone.
        let mut laser_rng = StdRng::seed_from_u64(seed);
        let mut wheel_rng = StdRng::seed_from_u64(seed ^ 0x5EED_0D0E);
        let mut odom_from_base = Pose2::IDENTITY;
        let observations = (0..truth.len())
            .map(|i| {
                if i > 0 {
                    let step = truth[i - 1].between(&truth[i]);
                    odom_from_base = odom_from_base * robot.wheels.measure(&step, &mut wheel_rng);
                }
                let micros = (i as f64 / robot.drive.scan_rate * 1e6).round() as i64;
                Observation {
                    robot: RobotId(0),
                    stamp: Stamp(Self::START_NANOS + 1000 * micros),
                    odom_from_base: Some(odom_from_base),
                    base_from_laser: robot.scanner.base_from_laser,
                    scan: robot.scanner.scan(world, &truth[i], &mut laser_rng),
                    sweep: None,
                    attitude: None,
                    sightings: Vec::new(),
                }
            })
            .collect();
        Run { plan: world.plan().clone(), truth, observations }
    }

    /// The run as that of a team's robot `number`: named so, and with stamps of its own, hours from
    /// those of the others, so that a stamp tells the robot.
    #[must_use]
    pub fn of_robot(mut self, number: u16) -> Run {
        for observation in &mut self.observations {
            observation.robot = RobotId(number);
            observation.stamp.0 += i64::from(number) * Self::APART_NANOS;
        }
        self
    }

    /// Length of the true path, metres.
    pub fn path_length(&self) -> f64 {
        self.truth.windows(2).map(|w| w[0].distance(&w[1])).sum()
    }
}
