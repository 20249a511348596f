use crate::FloorPlan;

/// The lobby of an office building, 16 x 11 m, seen at shin height: entrance, reception desk,
/// pillars, lifts, doors in reveals, benches by their legs, flower pots.
pub(crate) fn lobby() -> FloorPlan {
    let mut plan = FloorPlan::new();
    walls(&mut plan);
    // Square pillars in the middle, round ones at the entrance.
    for at in [(5.2, 3.6), (5.2, 7.4), (10.8, 3.6), (10.8, 7.4)] {
        plan.block(at, (0.45, 0.45), 0.0);
    }
    plan.pillar((6.4, 0.9), 0.2).pillar((9.6, 0.9), 0.2);
    // The reception desk, an L, with a chair behind it.
    plan.polyline(&[
        (11.9, 9.6),
        (11.9, 6.6),
        (14.3, 6.6),
        (14.3, 7.25),
        (12.6, 7.25),
        (12.6, 9.6),
        (11.9, 9.6),
    ]);
    plan.pillar((13.3, 8.3), 0.06);
    for (at, yaw) in [((2.2, 2.3), 1.57), ((2.2, 4.5), 1.57), ((8.0, 5.5), 0.0), ((8.0, 6.2), 0.0)]
    {
        plan.legs(at, (1.6, 0.42), yaw);
    }
    // A low table between the benches at the wall, a rack of brochures, a bin.
    plan.block((2.2, 3.4), (0.5, 0.5), 0.4).block((15.3, 4.4), (0.35, 1.1), 0.0);
    plan.pillar((11.5, 3.3), 0.18);
    for (at, radius) in [
        ((0.7, 1.0), 0.28),
        ((0.6, 10.2), 0.3),
        ((5.9, 5.8), 0.22),
        ((10.2, 5.9), 0.22),
        ((15.2, 0.8), 0.32),
        ((6.9, 10.4), 0.25),
    ] {
        plan.pillar(at, radius);
    }
    plan
}

/// Outer walls with an entrance, corridors leading off, lifts and closed doors.
fn walls(plan: &mut FloorPlan) {
    // South: the glazed entrance with its wind lobby.
    plan.partition((0.0, 0.0), (16.0, 0.0), &[(6.9, 2.2)]);
    plan.polyline(&[(6.9, 0.0), (6.9, -2.4), (7.3, -2.4)]);
    plan.polyline(&[(9.1, 0.0), (9.1, -2.4), (8.7, -2.4)]);
    plan.wall((5.0, -6.0), (11.0, -6.0));
    // North: two lifts in their reveals, then the way to the stairs.
    plan.partition((0.0, 11.0), (16.0, 11.0), &[(2.6, 1.1), (4.6, 1.1), (8.4, 1.6)]);
    plan.wall((2.5, 11.2), (3.8, 11.2)).wall((4.5, 11.2), (5.8, 11.2));
    plan.polyline(&[(8.4, 11.0), (8.4, 14.5), (10.0, 14.5), (10.0, 11.0)]);
    plan.block((9.7, 13.0), (0.4, 0.8), 0.0);
    // West: a closed door and a corridor.
    plan.partition((0.0, 0.0), (0.0, 11.0), &[(5.6, 0.95), (7.6, 1.8)]);
    plan.wall((-0.04, 5.5), (-0.04, 6.65));
    plan.polyline(&[(0.0, 7.6), (-9.0, 7.6), (-9.0, 9.4), (0.0, 9.4)]);
    // East: two closed doors and one that stands ajar.
    plan.partition((16.0, 0.0), (16.0, 11.0), &[(1.6, 0.95), (5.6, 0.95), (9.2, 0.95)]);
    plan.wall((16.04, 1.5), (16.04, 2.65)).wall((16.04, 9.1), (16.04, 10.25));
    plan.wall((16.0, 5.6), (16.55, 6.35));
    plan.polyline(&[(16.0, 4.6), (19.5, 4.6), (19.5, 8.2), (16.0, 8.2)]);
}
