use crate::{Attitude, BeamClass, Scan};
use geometry::{Matrix2, Pose2, Vector2};

/// What lies lower than this above the ground under the robot may be floor, metres: the thickness
/// of a threshold and of a few degrees' error at a few metres.
const FLOOR_M: f64 = 0.1;

/// A scan of a leaning robot as seen on the plan: walls stand upright, so what a beam hit on a wall
/// lies straight above its place on the plan (docs/math/elevation.md).
///
/// Points in the plane of the laser, in the base frame, are projected to the frame that has the
/// base's origin and heading but stands level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levelling {
    plan_from_laser_plane: Matrix2<f64>,
    shift: Vector2<f64>,
    /// Height of a point: `origin_m + slope . point`.
    origin_m: f64,
    slope: Vector2<f64>,
}

impl Levelling {
    /// For a base that leans by `attitude` and has its laser `laser_height_m` above the ground.
    pub fn new(attitude: &Attitude, laser_height_m: f64) -> Self {
        let (sr, cr) = attitude.roll_rad.sin_cos();
        let (sp, cp) = attitude.pitch_rad.sin_cos();
        Levelling {
            plan_from_laser_plane: Matrix2::new(cp, sr * sp, 0.0, cr),
            shift: Vector2::new(cr * sp, -sr) * laser_height_m,
            origin_m: laser_height_m * cr * cp,
            slope: Vector2::new(-sp, sr * cp),
        }
    }

    /// A direction of the laser's plane on the plan, shortened by the slope.
    pub fn rotate(&self, direction: Vector2<f64>) -> Vector2<f64> {
        self.plan_from_laser_plane * direction
    }

    /// A point of the laser's plane, base frame, on the plan.
    pub fn project(&self, point: Vector2<f64>) -> Vector2<f64> {
        self.rotate(point) + self.shift
    }

    /// A normal of a surface in the laser's plane, on the plan: not normalised; its length is by
    /// how much distances along it are stretched back.
    pub fn normal(&self, normal: Vector2<f64>) -> Vector2<f64> {
        // Inverse transpose of an upper triangular matrix.
        let m = &self.plan_from_laser_plane;
        let x = normal.x / m[(0, 0)];
        Vector2::new(x, (normal.y - m[(0, 1)] * x) / m[(1, 1)])
    }

    /// Height of a point of the laser's plane above the ground under the robot, metres.
    pub fn height_m(&self, point: Vector2<f64>) -> f64 {
        self.origin_m + self.slope.dot(&point)
    }

    /// Unit vector of the laser's plane, base frame, in which it rises most; zero where it is
    /// level.
    pub fn uphill(&self) -> Vector2<f64> {
        self.slope.try_normalize(1e-9).unwrap_or_else(Vector2::zeros)
    }

    /// True where a hit is too high for the floor under the robot.
    pub fn may_be_wall(&self, point: Vector2<f64>) -> bool {
        self.height_m(point) >= FLOOR_M
    }

    /// The laser's mounting on the plan; it looks where it looked.
    pub fn mounting(&self, base_from_laser: &Pose2) -> Pose2 {
        let at = self.project(base_from_laser.translation());
        Pose2::new(at.x, at.y, base_from_laser.yaw)
    }

    /// The scan on the plan, taken from [`Levelling::mounting`]: every beam of the same laser has
    /// what the beam saw that points there from the leaning one. Beams that may have met floor, and
    /// those that saw nothing, say nothing.
    pub fn scan(&self, scan: &Scan, base_from_laser: &Pose2) -> Scan {
        let laser = *scan.laser();
        let to_laser = Pose2::new(0.0, 0.0, -base_from_laser.yaw);
        let unit = |angle: f64| Vector2::new(angle.cos(), angle.sin());
        let back = self.plan_from_laser_plane.try_inverse().unwrap_or_else(Matrix2::identity);
        let seen = |beam: usize| {
            let wanted = base_from_laser.rotate(unit(laser.bearing(beam)));
            let leaning = to_laser.rotate(back * wanted);
            let turn = leaning.y.atan2(leaning.x) - laser.angle_min_rad;
            let turns = std::f64::consts::TAU * laser.angle_increment_rad.signum();
            // Bearings repeat: the first index that is no less than half a beam before the first.
            let index = (turn / laser.angle_increment_rad + 0.5)
                .rem_euclid(turns / laser.angle_increment_rad)
                .floor() as usize;
            let range = f64::from((index < scan.len()).then(|| scan.hit(index)).flatten()?);
            let hit = base_from_laser.rotate(unit(laser.bearing(index))) * range;
            let upright = self.may_be_wall(hit + base_from_laser.translation());
            upright.then(|| self.rotate(hit).norm() as f32)
        };
        let beams = (0..scan.len()).map(seen);
        let (ranges, classes): (Vec<f32>, Vec<BeamClass>) = beams
            .map(|range| match range {
                Some(range) => (range, BeamClass::Hit),
                None => (0.0, BeamClass::Invalid),
            })
            .unzip();
        Scan::from_parts(laser, ranges.into(), classes.into())
    }
}
