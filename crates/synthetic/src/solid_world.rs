use crate::{FloorPlan, LaserNoise, RayCaster, Scanner, standard_normal};
use geometry::{Pose3, Vector3};
use nalgebra::Vector2;
use rand::Rng;
use sensing::Scan;

/// A rectangle of ground, floor or ceiling, world frame, metres: level, or rising along x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Corner with the least x and y.
    pub min: (f64, f64),
    /// Corner with the greatest x and y.
    pub max: (f64, f64),
    /// Height along the side of the least x, and along that of the greatest.
    pub heights: (f64, f64),
}

impl Ground {
    /// A level rectangle.
    pub fn level(min: (f64, f64), max: (f64, f64), height: f64) -> Self {
        Ground { min, max, heights: (height, height) }
    }

    /// Rise per metre along x.
    pub fn slope(&self) -> f64 {
        (self.heights.1 - self.heights.0) / (self.max.0 - self.min.0)
    }

    /// Height above a place; `None` outside the rectangle.
    pub fn height(&self, place: Vector2<f64>) -> Option<f64> {
        let inside = (self.min.0..=self.max.0).contains(&place.x)
            && (self.min.1..=self.max.1).contains(&place.y);
        inside.then(|| self.heights.0 + self.slope() * (place.x - self.min.0))
    }

    /// Range along a ray to the first point on it, if it has one.
    fn range(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let above = origin.z - self.heights.0 - self.slope() * (origin.x - self.min.0);
        let range = -above / (direction.z - self.slope() * direction.x);
        let at = origin + direction * range;
        (range > 1e-9 && range.is_finite() && self.height(at.xy()).is_some()).then_some(range)
    }
}

/// A building of several storeys: upright walls that go all the way up, and what one stands on.
#[derive(Clone, Debug)]
pub struct SolidWorld {
    /// Of each storey; of the last one for all above it.
    walls: Vec<RayCaster>,
    storey_m: f64,
    ground: Vec<Ground>,
}

/// Wheels climb steps no higher than this from one place to the next, metres.
const STEP_M: f64 = 0.3;

impl SolidWorld {
    /// A world from its plan and its grounds.
    pub fn new(plan: FloorPlan, ground: Vec<Ground>) -> Self {
        SolidWorld { walls: vec![RayCaster::new(plan)], storey_m: f64::INFINITY, ground }
    }

    /// This world with further storeys of this height, each with walls of its own. Who stands on a
    /// storey sees the walls of that one: ramps must look alike on all.
    pub fn with_storeys(mut self, plans: Vec<FloorPlan>, storey_m: f64) -> Self {
        self.walls.extend(plans.into_iter().map(RayCaster::new));
        self.storey_m = storey_m;
        self
    }

    /// The plan of the lowest storey, which all share unless they were given their own.
    pub fn plan(&self) -> &FloorPlan {
        self.walls[0].plan()
    }

    /// Range to the first surface along a unit vector; `None` beyond `max_range`, metres.
    pub fn cast(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        max_range: f64,
    ) -> Option<f64> {
        let flat = direction.xy();
        let share = flat.norm();
        let storey = (origin.z / self.storey_m).max(0.0) as usize;
        let walls = &self.walls[storey.min(self.walls.len() - 1)];
        let wall = (share > 1e-9)
            .then(|| walls.cast(origin.xy(), flat / share, max_range * share))
            .flatten()
            .map(|hit| hit.range / share);
        let grounds = self.ground.iter().filter_map(|g| g.range(origin, direction));
        grounds.chain(wall).reduce(f64::min).filter(|range| *range <= max_range)
    }

    /// Height of the ground that one comes to at a place, coming from one of height `from`.
    pub fn step_to(&self, place: Vector2<f64>, from: f64) -> f64 {
        let heights = self.ground.iter().filter_map(|g| g.height(place));
        heights.filter(|h| (h - from).abs() < STEP_M).reduce(f64::max).unwrap_or(from)
    }

    /// A scan by a laser `laser_height` metres above a base at `world_from_base`.
    pub fn scan(
        &self,
        scanner: &Scanner,
        laser_height: f64,
        world_from_base: &Pose3,
        rng: &mut impl Rng,
    ) -> Scan {
        let mounting = &scanner.base_from_laser;
        let LaserNoise { range_std, bearing_std, dropout, quantisation, .. } = scanner.noise;
        let at = mounting.translation();
        let origin = world_from_base.transform(Vector3::new(at.x, at.y, laser_height));
        let reading = |beam: usize| {
            let angle =
                mounting.yaw + scanner.laser.bearing(beam) + bearing_std * standard_normal(rng);
            let error = range_std * standard_normal(rng);
            let dropped = rng.random::<f64>() < dropout;
            let ray = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let direction = world_from_base.rotation * ray;
            match self.cast(&origin, &direction, scanner.max_range()).filter(|_| !dropped) {
                Some(range) if quantisation > 0.0 => {
                    (((range + error) / quantisation).round() * quantisation).max(0.0) as f32
                }
                Some(range) => (range + error).max(0.0) as f32,
                None => scanner.laser.range_max_m + 1.0,
            }
        };
        let readings: Vec<f32> = (0..scanner.laser.beams as usize).map(reading).collect();
        Scan::classify(scanner.laser, &readings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room 4 m wide with a ramp in it, against geometry done by hand.
    #[test]
    fn rays_meet_walls_floor_and_ramp() {
        let mut plan = FloorPlan::new();
        plan.rectangle((0.0, -2.0), (30.0, 2.0));
        let ramp = Ground { min: (10.0, -2.0), max: (30.0, 2.0), heights: (0.0, 4.0) };
        let floor = Ground::level((0.0, -2.0), (10.0, 2.0), 0.0);
        let world = SolidWorld::new(plan, vec![floor, ramp]);
        let origin = Vector3::new(5.0, 0.0, 0.4);
        let cast = |x: f64, y: f64, z: f64| {
            world.cast(&origin, &Vector3::new(x, y, z).normalize(), 80.0).unwrap()
        };
        // Ahead the ramp is 0.4 m high 2 m behind its foot; downwards there is the floor.
        assert!((cast(1.0, 0.0, 0.0) - 7.0).abs() < 1e-9);
        assert!((cast(0.0, 1.0, 0.0) - 2.0).abs() < 1e-9);
        assert!((cast(-3.0, 0.0, -4.0) - 0.5).abs() < 1e-9);
        // Along the ramp's slope the end wall is seen, above it.
        assert!((cast(1.0, 0.0, 0.5) - 25.0 * 1.25f64.sqrt()).abs() < 1e-9);
        assert_eq!(world.step_to(Vector2::new(11.0, 0.0), 0.1), 0.2);
        assert_eq!(world.step_to(Vector2::new(11.0, 0.0), 3.0), 3.0);
    }
}
