use super::{Ascent, Storeys};
use crate::buildings::furnish;
use crate::{FloorPlan, Ground, SolidWorld};
use rand::rngs::StdRng;

/// Depth of the main part, and from where to where ramps run beside it, metres.
const DEPTH: f64 = 13.0;
pub const LANE: f64 = 2.2;
const WALL: f64 = 0.12;
/// Ramps begin this far from the west wall, and landings are at least this long.
pub const LANDING: f64 = 3.0;

/// Measures of a building: rooms in the south, a block with corridors around it, and the ramps
/// along the north.
pub struct Building {
    pub width: f64,
    /// East end of the ramps.
    pub ramp_end: f64,
    /// North wall of the ramps.
    pub north: f64,
    pub ascent: Ascent,
}

impl Building {
    pub fn new(spec: &Storeys) -> Self {
        let (rise, lanes) = match spec.ascent {
            Ascent::Straight => (spec.height_m, 1.0),
            Ascent::Turning => (0.5 * spec.height_m, 2.0),
        };
        let ramp_end = LANDING + rise / spec.slope_rad.tan();
        let width = (ramp_end + LANDING).max(20.0);
        let north = DEPTH + lanes * LANE + (lanes - 1.0) * WALL;
        Building { width, ramp_end, north, ascent: spec.ascent }
    }

    pub fn world(&self, spec: &Storeys, way: &[(f64, f64)], rng: &mut StdRng) -> SolidWorld {
        let world = SolidWorld::new(self.plan(way, rng), self.grounds(spec));
        if spec.furnished_alike {
            return world;
        }
        let further = (1..spec.storeys).map(|_| self.plan(way, rng)).collect();
        world.with_storeys(further, spec.height_m)
    }

    /// Walls and furniture.
    fn plan(&self, way: &[(f64, f64)], rng: &mut StdRng) -> FloorPlan {
        let w = self.width;
        let mut plan = FloorPlan::new();
        plan.rectangle((0.0, 0.0), (w, self.north));
        let ramp_doors = [(0.9, 1.2), (w - 2.1, 1.2)];
        let doors =
            if self.ascent == Ascent::Straight { &ramp_doors[..] } else { &ramp_doors[..1] };
        plan.partition((0.0, DEPTH), (w, DEPTH), doors);
        if self.ascent == Ascent::Turning {
            let y = DEPTH + LANE + 0.5 * WALL;
            plan.partition((LANDING, y), (self.ramp_end, y), &[]);
            plan.partition(
                (self.ramp_end + LANDING, DEPTH),
                (self.ramp_end + LANDING, self.north),
                &[],
            );
        }
        let third = w / 3.0;
        let room_doors = [(0.4 * third, 0.9), (1.6 * third, 1.0), (2.3 * third, 0.9)];
        plan.partition((0.0, 5.0), (w, 5.0), &room_doors);
        plan.partition((third, 0.0), (third, 5.0), &[]);
        plan.partition((2.0 * third, 0.0), (2.0 * third, 5.0), &[]);
        plan.partition((3.0, 7.0), (w - 3.0, 7.0), &[(0.3 * w, 1.0)]);
        plan.partition((3.0, 11.0), (w - 3.0, 11.0), &[(0.55 * w, 0.9)]);
        plan.partition((3.0, 7.0), (3.0, 11.0), &[]);
        plan.partition((w - 3.0, 7.0), (w - 3.0, 11.0), &[(1.5, 0.9)]);
        plan.partition((0.5 * w, 7.0), (0.5 * w, 11.0), &[]);
        for room in 0..3 {
            let x = f64::from(room) * third;
            furnish(&mut plan, rng, (x + 0.4, 0.4), (x + third - 0.4, 4.6), way);
        }
        furnish(&mut plan, rng, (3.4, 7.4), (0.5 * w - 0.4, 10.6), way);
        furnish(&mut plan, rng, (0.5 * w + 0.4, 7.4), (w - 3.4, 10.6), way);
        plan
    }

    /// Floors, landings, ramps and the roof.
    fn grounds(&self, spec: &Storeys) -> Vec<Ground> {
        let mut grounds = Vec::new();
        let landings = |height: f64| {
            let main = Ground::level((0.0, 0.0), (self.width, DEPTH), height);
            let west = Ground::level((0.0, DEPTH), (LANDING, self.north), height);
            let east = Ground::level((self.ramp_end, DEPTH), (self.width, self.north), height);
            [main, west, east]
        };
        for storey in 0..=spec.storeys {
            let height = storey as f64 * spec.height_m;
            let [main, west, east] = landings(height);
            grounds.extend([main, west]);
            if self.ascent == Ascent::Straight {
                grounds.push(east);
            }
            if storey + 1 < spec.storeys {
                grounds.extend(self.ramp(height, spec.height_m));
            }
        }
        let roof = spec.storeys as f64 * spec.height_m;
        grounds.push(Ground::level((0.0, DEPTH), (self.width, self.north), roof));
        grounds
    }

    /// The way from the floor at `low` to the next one.
    fn ramp(&self, low: f64, height: f64) -> Vec<Ground> {
        let lane = |y: f64, heights: (f64, f64)| Ground {
            min: (LANDING, y),
            max: (self.ramp_end, y + LANE),
            heights,
        };
        match self.ascent {
            Ascent::Straight => vec![lane(DEPTH, (low, low + height))],
            Ascent::Turning => {
                let half = low + 0.5 * height;
                let end = (self.ramp_end + LANDING, self.north);
                vec![
                    lane(DEPTH, (low, half)),
                    lane(DEPTH + LANE + WALL, (low + height, half)),
                    Ground::level((self.ramp_end, DEPTH), end, half),
                ]
            }
        }
    }

    /// Middle of the first lane.
    pub fn first_lane(&self) -> f64 {
        DEPTH + 0.5 * LANE
    }

    /// Middle of the second lane.
    pub fn second_lane(&self) -> f64 {
        DEPTH + 1.5 * LANE + WALL
    }
}
