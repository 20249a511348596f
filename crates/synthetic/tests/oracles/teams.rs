//! Teams in look-alike places: nobody drives through a wall, copies are copies and the rest is not.

use geometry::{Pose2, Vector2};
use manifoldslam_synthetic as synthetic;
use synthetic::{FloorPlan, Meeting, RayCaster, Run, TwinCase, TwinFamily, twins};

/// Walls do not pass between successive poses, and rays along 16 bearings from every third pose
/// are longer than this: what a robot of 0.4 m width needs.
const CLEARANCE_M: f64 = 0.2;

pub(crate) fn assert_clear(run: &Run, world: &RayCaster, name: &str) {
    for (i, pair) in run.truth.windows(2).enumerate() {
        let step = pair[1].translation() - pair[0].translation();
        if step.norm() > 1e-9 {
            let hit = world.cast(pair[0].translation(), step.normalize(), step.norm());
            assert!(hit.is_none(), "{name}: through a wall at scan {i}, {:?}", pair[0]);
        }
        for k in (0..16).filter(|_| i % 3 == 0) {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 16.0).sin_cos();
            let hit = world.cast(pair[0].translation(), Vector2::new(cos, sin), CLEARANCE_M);
            assert!(hit.is_none(), "{name}: {hit:?} at scan {i}, {:?}", pair[0]);
        }
    }
}

fn cases() -> impl Iterator<Item = (String, TwinCase)> {
    // 43 and 59: the corridor that looks alike lies between two stops.
    (0..12).chain([43, 59]).flat_map(|seed| {
        TwinFamily::ALL.into_iter().flat_map(move |family| {
            [Meeting::Apart, Meeting::Together].map(|meeting| {
                (format!("{family:?} {seed} {meeting:?}"), twins(family, seed, meeting))
            })
        })
    })
}

#[test]
fn twins_drive_clear_of_walls_and_have_their_own_stamps() {
    for (name, case) in cases() {
        let world = RayCaster::new(case.runs[0].plan.clone());
        let mut stamps: Vec<i64> = Vec::new();
        for run in &case.runs {
            assert_clear(run, &world, &name);
            stamps.extend(run.observations.iter().map(|observation| observation.stamp.0));
        }
        let count = stamps.len();
        stamps.sort_unstable();
        stamps.dedup();
        assert_eq!(count, stamps.len(), "{name}");
    }
}

#[test]
fn islands_are_the_buildings_driven_in() {
    for (name, case) in cases() {
        let mut buildings = case.buildings.clone();
        buildings.sort_unstable();
        buildings.dedup();
        assert_eq!(buildings.len(), case.true_islands, "{name}");
        // Robots of different buildings are too far apart to see the same; others meet.
        for (a, b) in [(0, 1), (0, case.runs.len() - 1)] {
            let nearest = nearest(&case.runs[a], &case.runs[b]);
            if case.buildings[a] == case.buildings[b] {
                assert!(nearest < 1.0, "{name}: {nearest} m");
            } else {
                assert!(nearest > 15.0, "{name}: {nearest} m");
            }
        }
    }
}

fn nearest(a: &Run, b: &Run) -> f64 {
    let pairs = a.truth.iter().flat_map(|p| b.truth.iter().map(move |q| p.distance(q)));
    pairs.fold(f64::INFINITY, f64::min)
}

/// A building's walls between two limits along its corridor, as rows of numbers that are the same
/// for walls that are.
fn walls_of(plan: &FloorPlan, pose: &Pose2, mirrored: bool, limits: (f64, f64)) -> Vec<[i64; 4]> {
    let building_from_world = pose.inverse();
    let (start, end) = limits;
    let local = |point: Vector2<f64>| {
        let p = building_from_world.transform(point);
        Vector2::new(p.x - start, if mirrored { -p.y } else { p.y })
    };
    let within = |p: &Vector2<f64>| (-1e-3..=end - start + 1e-3).contains(&p.x) && p.y.abs() < 12.0;
    let whole = |value: f64| (1e4 * value).round() as i64;
    let ends = plan.walls.iter().map(|wall| (local(wall.from), local(wall.to)));
    ends.filter(|(a, b)| within(a) && within(b))
        .map(|(a, b)| [whole(a.x), whole(a.y), whole(b.x), whole(b.y)])
        .collect()
}

/// The share of one building's walls that the other has too.
fn share_copied(case: &TwinCase, widened_m: f64) -> f64 {
    let part = &case.part;
    let [one, two] = [0, 1].map(|i| {
        let (start, end) = part.along[i];
        let mirrored = part.mirrored && i == 1;
        let pose = &part.world_from_building[i];
        let limits = (start - widened_m, end + widened_m);
        walls_of(&case.runs[0].plan, pose, mirrored, limits)
    });
    // A unit of the last place may go either way by rounding.
    let same = |a: &[i64; 4], b: &[i64; 4]| a.iter().zip(b).all(|(p, q)| (p - q).abs() <= 1);
    let found = one.iter().filter(|a| two.iter().any(|b| same(a, b))).count();
    assert!(one.len() > 10, "{:?} has {} walls", case.family, one.len());
    found as f64 / one.len() as f64
}

#[test]
fn copies_are_copies_and_the_rest_differs() {
    let (mut redrawn, mut different) = (0, 0);
    for (name, case) in cases() {
        let share = share_copied(&case, 0.0);
        if case.part.exact {
            assert!(share > 0.99, "{name}: {share}");
        } else {
            assert!(share > 0.3, "{name}: {share}");
            redrawn += 1;
            different += usize::from(share < 0.99);
        }
        // A building that is nothing but a copy has no surroundings.
        if case.family != TwinFamily::Mirrored {
            let with_surroundings = share_copied(&case, 6.0);
            assert!(with_surroundings < 0.95 * share, "{name}: {share}, {with_surroundings}");
        }
    }
    // Furniture finds no place in a few of the smallest rooms.
    assert!(10 * different >= 9 * redrawn, "{different} of {redrawn}");
}
