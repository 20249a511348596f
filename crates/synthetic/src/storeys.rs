mod building;
mod route;

use crate::{InertialUnit, Robot, Run, SolidWorld};
use building::Building;
use geometry::{Pose2, Pose3, Vector2, Vector3};
use nalgebra::UnitQuaternion;
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::{Attitude, Observation, RobotId, Stamp};

/// How one gets from storey to storey.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ascent {
    /// One straight ramp or flight of stairs.
    Straight,
    /// Two that lie side by side, with a landing half way up.
    Turning,
}

/// A building whose storeys all have the same plan, and how a robot drives through all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Storeys {
    /// Number of storeys.
    pub storeys: usize,
    /// From floor to floor, metres.
    pub height_m: f64,
    /// Steepness of the ramps, radians.
    pub slope_rad: f64,
    /// Kind of ramp.
    pub ascent: Ascent,
    /// All storeys have the same furniture; else each has its own.
    pub furnished_alike: bool,
    /// The robot starts on the top storey and ends there.
    pub from_the_top: bool,
    /// Amplitude of the base's pitching on ramps, radians: tracks on stairs.
    pub pitching_rad: f64,
    /// Height of the laser above the ground, metres.
    pub laser_height_m: f64,
    /// The inertial unit; a bias of up to `largest_bias_rad` is added by the seed.
    pub unit: InertialUnit,
    /// Bias of the unit either way, radians.
    pub largest_bias_rad: f64,
}

impl Default for Storeys {
    /// Two storeys 3 m apart with a straight ramp of 10 degrees.
    fn default() -> Self {
        Storeys {
            storeys: 2,
            height_m: 3.0,
            slope_rad: f64::to_radians(10.0),
            ascent: Ascent::Straight,
            furnished_alike: true,
            from_the_top: false,
            pitching_rad: 0.0,
            laser_height_m: 0.3,
            unit: InertialUnit::default(),
            largest_bias_rad: f64::to_radians(2.0),
        }
    }
}

/// A drive through several storeys with its truth.
#[derive(Clone, Debug)]
pub struct StoreysRun {
    /// The drive; its truth is on the plan.
    pub run: Run,
    /// True height of the base at every scan above the lowest floor, metres.
    pub heights_m: Vec<f64>,
    /// True attitude of the base at every scan.
    pub attitudes: Vec<Attitude>,
    /// From floor to floor, metres.
    pub storey_height_m: f64,
}

/// Distance from the base's origin to where its wheels touch the ground, metres.
const AXLE_M: f64 = 0.25;
const WHEEL_M: f64 = 0.2;
/// Tracks on stairs pitch once on this way, metres: a step.
const STEP_LENGTH_M: f64 = 0.3;
/// Steeper than this is a ramp, radians.
const RAMP_RAD: f64 = 0.03;

impl StoreysRun {
    /// The storey whose floor is nearest at a scan.
    pub fn storey(&self, scan: usize) -> usize {
        (self.heights_m[scan] / self.storey_height_m).round().max(0.0) as usize
    }

    /// True where the robot stands on a floor: neither on a ramp nor on a landing.
    pub fn on_floor(&self, scan: usize) -> bool {
        let off = self.heights_m[scan] - self.storey(scan) as f64 * self.storey_height_m;
        off.abs() < 0.05 && self.attitudes[scan].pitch_rad.abs() < RAMP_RAD
    }
}

impl Storeys {
    /// Records a drive through the building that `seed` furnishes: a round and more on every
    /// storey, up all ramps and down again.
    pub fn record(&self, robot: &Robot, seed: u64) -> StoreysRun {
        let rng = &mut StdRng::seed_from_u64(seed ^ 0x57_0E75);
        let building = Building::new(self);
        let (waypoints, start_m) = building.route(self);
        let world = building.world(self, &waypoints, rng);
        let truth = robot.drive.poses(&waypoints);
        let (heights_m, attitudes) = self.stand(&world, &truth, start_m);
        let largest = self.largest_bias_rad;
        let mut bias =
            |b: f64| if largest > 0.0 { b + rng.random_range(-largest..largest) } else { b };
        let bias = Attitude {
            roll_rad: bias(self.unit.bias.roll_rad),
            pitch_rad: bias(self.unit.bias.pitch_rad),
        };
        let unit = InertialUnit { bias, ..self.unit };
        let readings = unit.read(&attitudes, robot.drive.scan_rate.recip(), rng);
        let mut odom_from_base = Pose2::IDENTITY;
        let observations = (0..truth.len()).map(|i| {
            if i > 0 {
                let step = along_slope(&truth[i - 1].between(&truth[i]), &attitudes[i]);
                odom_from_base = odom_from_base * robot.wheels.measure(&step, rng);
            }
            let base = in_space(&truth[i], heights_m[i], &attitudes[i]);
            let micros = (i as f64 / robot.drive.scan_rate * 1e6).round() as i64;
            Observation {
                robot: RobotId(0),
                stamp: Stamp(1_000_000_000_000 + 1000 * micros),
                odom_from_base: Some(odom_from_base),
                base_from_laser: robot.scanner.base_from_laser,
                scan: world.scan(&robot.scanner, self.laser_height_m, &base, rng),
                sweep: None,
                attitude: Some(readings[i]),
                sightings: Vec::new(),
            }
        });
        let observations = observations.collect();
        let run = Run { plan: world.plan().clone(), truth, observations };
        StoreysRun { run, heights_m, attitudes, storey_height_m: self.height_m }
    }

    /// Height and attitude of a base whose wheels stand on the ground all along a way.
    fn stand(
        &self,
        world: &SolidWorld,
        truth: &[Pose2],
        start_m: f64,
    ) -> (Vec<f64>, Vec<Attitude>) {
        let mut height = start_m;
        let mut way_m = 0.0;
        let mut last = truth.first().copied().unwrap_or_default();
        let stood = truth.iter().map(|pose| {
            way_m += last.distance(pose);
            last = *pose;
            let ground = |x: f64, y: f64| world.step_to(pose.transform(Vector2::new(x, y)), height);
            let (front, rear) = (ground(AXLE_M, 0.0), ground(-AXLE_M, 0.0));
            let (left, right) = (ground(0.0, WHEEL_M), ground(0.0, -WHEEL_M));
            height = 0.5 * (front + rear);
            let mut pitch_rad = -((front - rear) / (2.0 * AXLE_M)).atan();
            if pitch_rad.abs() > RAMP_RAD {
                let phase = way_m / STEP_LENGTH_M * std::f64::consts::TAU;
                pitch_rad += self.pitching_rad * phase.sin();
            }
            let roll_rad = ((left - right) / (2.0 * WHEEL_M)).atan();
            (height, Attitude { roll_rad, pitch_rad })
        });
        stood.unzip()
    }
}

/// A step on the plan as wheels count it.
fn along_slope(step: &Pose2, attitude: &Attitude) -> Pose2 {
    Pose2::new(step.x / attitude.pitch_rad.cos(), step.y / attitude.roll_rad.cos(), step.yaw)
}

fn in_space(plan: &Pose2, height_m: f64, attitude: &Attitude) -> Pose3 {
    let Attitude { roll_rad, pitch_rad } = *attitude;
    let rotation = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, plan.yaw);
    Pose3::new(Vector3::new(plan.x, plan.y, height_m), rotation)
}
