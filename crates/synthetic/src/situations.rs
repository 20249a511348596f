use crate::lobby::lobby;
use crate::wood::wood;
use crate::{FloorPlan, LaserNoise, RayCaster, RoomPair, Scanner};
use geometry::Pose2;
use rand::{SeedableRng, rngs::StdRng};

/// The four situations of the ManifoldSLAM thesis's comparison of scan matchers (2006, section
/// 7.1.2): two scans each of 361 beams over half a circle.
///
/// The thesis describes the places and does not publish its scans; these are places of the same
/// kind, laid out from the description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Situation {
    /// Indoor, many features: the lobby of an office building; 1.2 m and 30 degrees apart.
    Lobby,
    /// Indoor, few features: a long corridor with four doorways; 0.7 m and 5 degrees apart.
    Corridor,
    /// Outdoor, very few features: tree trunks; 0.8 m and 20 degrees apart.
    Wood,
    /// The best case: the lobby's first scan against itself, noise and all.
    SameScan,
}

impl Situation {
    /// All four, in the thesis's order.
    pub const ALL: [Situation; 4] =
        [Situation::Lobby, Situation::Corridor, Situation::Wood, Situation::SameScan];
    /// Beams of a scan.
    pub const BEAMS: u32 = 361;
    /// The wood's trees; any other number gives another wood.
    const WOOD: u64 = 2006;

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Situation::Lobby => "lobby",
            Situation::Corridor => "corridor",
            Situation::Wood => "wood",
            Situation::SameScan => "same-scan",
        }
    }

    /// The situation of this name; `None` for an unknown one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|situation| situation.name() == name)
    }

    /// Everything a laser can see there.
    pub fn plan(self) -> FloorPlan {
        match self {
            Situation::Lobby | Situation::SameScan => lobby(),
            Situation::Corridor => corridor_with_doorways(),
            Situation::Wood => wood(Self::WOOD),
        }
    }

    /// True base poses of the reference and of the scan, world frame.
    pub fn poses(self) -> (Pose2, Pose2) {
        let (reference, step) = match self {
            Situation::Lobby => (Pose2::new(3.6, 5.2, 0.1), (1.12, 0.43, 30.0_f64)),
            Situation::Corridor => (Pose2::new(0.0, 0.15, 0.05), (0.7, 0.03, 5.0)),
            Situation::Wood => (Pose2::new(-0.4, 0.0, 0.3), (0.76, -0.25, -20.0)),
            Situation::SameScan => (Pose2::new(3.6, 5.2, 0.1), (0.0, 0.0, 0.0)),
        };
        (reference, reference * Pose2::new(step.0, step.1, step.2.to_radians()))
    }

    /// The scanner of the comparison with this noise.
    pub fn scanner(noise: LaserNoise) -> Scanner {
        Scanner::half_circle(Self::BEAMS, noise)
    }

    /// The two scans with noise drawn from a seed; one scan twice in [`Situation::SameScan`].
    pub fn pair(self, world: &RayCaster, scanner: &Scanner, seed: u64) -> RoomPair {
        let rng = &mut StdRng::seed_from_u64(seed.wrapping_mul(0x9E37_79B9).wrapping_add(7));
        let (world_from_reference, world_from_scan) = self.poses();
        let reference = scanner.scan(world, &world_from_reference, rng);
        let scan = match self {
            Situation::SameScan => reference.clone(),
            _ => scanner.scan(world, &world_from_scan, rng),
        };
        RoomPair { world: world.clone(), reference, scan, world_from_reference, world_from_scan }
    }
}

/// A corridor 2.1 m wide along x, too long for either end to be seen, with two doorways on each
/// side and a room behind each.
fn corridor_with_doorways() -> FloorPlan {
    let mut plan = FloorPlan::new();
    let (west, east, y) = (-25.0, 45.0, 1.11);
    plan.partition((west, y), (east, y), &[(27.6, 0.95), (35.4, 0.95)]);
    plan.partition((west, -y), (east, -y), &[(30.1, 0.95), (39.2, 0.95)]);
    for (x0, x1, side) in [(0.8, 5.0, 1.0), (8.9, 13.1, 1.0), (3.6, 8.0, -1.0), (12.2, 16.6, -1.0)]
    {
        let (near, far) = (side * y, side * 6.0);
        plan.polyline(&[(x0, near), (x0, far), (x1, far), (x1, near)]);
        // A cupboard and a desk's side: the little that is seen of a room.
        plan.block((x1 - 0.35, side * 3.1), (0.5, 1.2), 0.0);
        plan.block((x0 + 1.2, side * 4.6), (1.5, 0.7), 0.0);
    }
    plan
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(situation: Situation, seed: u64) -> RoomPair {
        let world = RayCaster::new(situation.plan());
        situation.pair(&world, &Situation::scanner(LaserNoise::usarsim()), seed)
    }

    #[test]
    fn the_lobby_s_scans_are_as_far_apart_as_the_thesis_says() {
        let pair = pair(Situation::Lobby, 1);
        let truth = pair.truth();
        assert!((truth.norm() - 1.2).abs() < 0.01, "{}", truth.norm());
        assert!((truth.yaw.to_degrees() - 30.0).abs() < 1e-9);
        for scan in [&pair.reference, &pair.scan] {
            assert!(scan.hit_count() * 100 > scan.len() * 97, "{} hits", scan.hit_count());
        }
    }

    #[test]
    fn most_beams_return_nothing_from_the_wood() {
        let pair = pair(Situation::Wood, 1);
        for scan in [&pair.reference, &pair.scan] {
            let empty = scan.len() - scan.hit_count();
            assert!(empty * 10 > scan.len() * 6 && scan.hit_count() > 40, "{empty} empty");
        }
        let plan = Situation::Wood.plan();
        assert!(plan.walls.is_empty());
        assert!(plan.circles.iter().all(|tree| (0.08..0.3).contains(&tree.radius)));
    }

    #[test]
    fn the_robot_stands_free_in_every_situation() {
        for situation in Situation::ALL {
            let (a, b) = situation.poses();
            for pose in [a, b] {
                let clear = situation.plan().clearance(pose.translation());
                assert!(clear > 0.5, "{}: {clear} m", situation.name());
            }
        }
    }

    #[test]
    fn a_seed_is_a_pair_and_another_seed_another() {
        for situation in Situation::ALL {
            assert_eq!(Situation::named(situation.name()), Some(situation));
            let [a, b, c] = [5, 5, 6].map(|seed| pair(situation, seed));
            assert_eq!((&a.reference, &a.scan), (&b.reference, &b.scan));
            assert_ne!(a.reference, c.reference);
            assert_eq!(a.reference == a.scan, situation == Situation::SameScan);
        }
    }

    #[test]
    fn a_range_is_at_most_a_thousandth_off() {
        let world = RayCaster::new(Situation::Lobby.plan());
        let scanner = Situation::scanner(LaserNoise::usarsim());
        let pair = Situation::Lobby.pair(&world, &scanner, 3);
        let truth = scanner.truth(&world, &pair.world_from_reference);
        let errors: Vec<f64> = (0..pair.reference.len())
            .filter_map(|i| Some((f64::from(pair.reference.hit(i)?), truth[i]?.range)))
            .map(|(read, truth)| read / truth - 1.0)
            .collect();
        assert!(errors.iter().all(|e| e.abs() < 0.001_001));
        let mean_square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        let expected = scanner.noise.range_std_at(1.0);
        assert!((mean_square.sqrt() / expected - 1.0).abs() < 0.15, "{mean_square} {expected}");
    }
}
