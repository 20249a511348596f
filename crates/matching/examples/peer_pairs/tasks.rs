use crate::common::{SubmapScene, bound};
use crate::pair::Pair;
use geometry::Pose2;
use rand::{Rng, SeedableRng, rngs::StdRng};
use synthetic::{LaserNoise, Scanner, noisy_room_pair};

/// Standard deviation of all ranges, metres.
const NOISE_STD: f64 = 0.015;
/// Distance (metres) and turn (degrees) between the scans and between guess and truth: what
/// odometry leaves at worst.
const FAR: (f64, f64) = (0.3, 10.0);
/// What a motion model leaves from one scan to the next.
const NEAR: (f64, f64) = (0.03, 0.6);
/// Distances and turns are drawn within this share of the nominal ones: a matcher that searches in
/// steps must not find the truth among its steps each time.
const SPREAD: f64 = 0.05;

/// A pair of each task in the room of this seed.
pub fn pairs(seed: u64) -> [Pair; 3] {
    let rng = &mut StdRng::seed_from_u64(seed ^ 0x9A12);
    let mut draw = |(distance, degrees): (f64, f64)| {
        let mut about = |value: f64| value * rng.random_range(1.0 - SPREAD..1.0 + SPREAD);
        (about(distance), about(degrees.to_radians()))
    };
    let scene = SubmapScene::new(seed, NOISE_STD);
    [
        scan_to_scan(seed, draw(FAR)),
        submap("submap", &scene, seed, draw(FAR)),
        submap("tracking", &scene, seed, draw(NEAR)),
    ]
}

/// Two scans, from the identity.
fn scan_to_scan(seed: u64, (distance, turn): (f64, f64)) -> Pair {
    let scanner = Scanner::half_circle(361, LaserNoise::gaussian(NOISE_STD));
    let pair = noisy_room_pair(seed, &scanner, distance, turn);
    let (from, to) = (pair.world_from_reference, pair.world_from_scan);
    Pair {
        task: "scan".into(),
        guess: Pose2::IDENTITY,
        truth: pair.truth(),
        bound: bound(&scanner, &pair.world, &[from], &to),
        reference: vec![(pair.reference, Pose2::IDENTITY)],
        scan: pair.scan,
    }
}

/// A scan and six others.
fn submap(task: &str, scene: &SubmapScene, seed: u64, (distance, turn): (f64, f64)) -> Pair {
    Pair {
        task: task.into(),
        guess: scene.guess(seed, distance, turn),
        truth: scene.truth,
        bound: scene.bound,
        reference: scene.submap.clone(),
        scan: scene.scan.clone(),
    }
}
