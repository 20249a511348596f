use crate::FloorPlan;
use geometry::Vector2;
use rand::{Rng, SeedableRng, rngs::StdRng};

/// Half the side of the square that trees stand in, metres.
const HALF_SIDE: f64 = 26.0;
/// Trees on a square metre: an open stand of 400 on a hectare.
const DENSITY: f64 = 0.04;
/// No two trunks stand nearer to each other, from middle to middle, metres.
const SPACING: f64 = 1.2;
/// The robot's surroundings are free of trees, metres.
const CLEARING: f64 = 1.5;

/// Tree trunks at random around the origin, 0.08 to 0.3 m in radius, and nothing else.
pub(crate) fn wood(seed: u64) -> FloorPlan {
    let rng = &mut StdRng::seed_from_u64(seed);
    let trees = (DENSITY * 4.0 * HALF_SIDE * HALF_SIDE) as usize;
    let mut plan = FloorPlan::new();
    while plan.circles.len() < trees {
        let mut coordinate = || rng.random_range(-HALF_SIDE..HALF_SIDE);
        let (x, y) = (coordinate(), coordinate());
        let radius = rng.random_range(0.08..0.3);
        let at = Vector2::new(x, y);
        let crowded = plan.circles.iter().any(|tree| (tree.centre - at).norm() < SPACING);
        if !crowded && at.norm() > CLEARING + radius {
            plan.pillar((x, y), radius);
        }
    }
    plan
}
