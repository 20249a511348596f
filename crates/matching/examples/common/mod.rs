//! A scan against a submap of six scans in a random room, and the bound of any match in a room.

use geometry::{Matrix3, Pose2, Vector2};
use manifoldslam_matching::{CloudPoint, PointCloud, cramer_rao_bound, fisher_information};
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::Scan;
use synthetic::{LaserNoise, RayCaster, Scanner, TrueBeam, noisy_room};

/// Scans that make up a submap.
pub const SUBMAP_SCANS: usize = 6;
/// A true endpoint this near to one of the reference's has been seen before, metres.
const SEEN_M: f64 = 0.1;

/// Six scans from near the middle of a room, and a seventh. The submap's frame is the world.
pub struct SubmapScene {
    /// The scans of the submap, each with `world_from_scan`.
    pub submap: Vec<(Scan, Pose2)>,
    /// The seventh scan.
    pub scan: Scan,
    /// Where the seventh was taken.
    pub truth: Pose2,
    /// Smallest covariance of the seventh's pose, as a right perturbation.
    pub bound: Option<Matrix3<f64>>,
}

impl SubmapScene {
    /// The scene of this seed, with 361 beams over the front half circle.
    pub fn new(seed: u64, noise_std: f64) -> Self {
        let rng = &mut StdRng::seed_from_u64(seed.wrapping_mul(0x9E37_79B9) + 77);
        let world = RayCaster::new(noisy_room(seed));
        let scanner = Scanner::half_circle(361, LaserNoise::gaussian(noise_std));
        let heading = rng.random_range(-3.1..3.1);
        let mut pose = || {
            let near = |m: f64, rng: &mut StdRng| rng.random_range(-m..m);
            Pose2::new(near(0.6, rng), near(0.6, rng), heading + near(0.3, rng))
        };
        let poses: Vec<Pose2> = (0..SUBMAP_SCANS).map(|_| pose()).collect();
        let truth = pose();
        let noise_rng = &mut StdRng::seed_from_u64(seed ^ 0xBEA3);
        let mut see = |pose: &Pose2| scanner.scan(&world, pose, noise_rng);
        let submap = poses.iter().map(|pose| (see(pose), *pose)).collect();
        let scan = see(&truth);
        let bound = bound(&scanner, &world, &poses, &truth);
        SubmapScene { submap, scan, truth, bound }
    }

    /// A pose this far from the truth, in a direction drawn from the seed.
    pub fn guess(&self, seed: u64, distance: f64, turn: f64) -> Pose2 {
        let rng = &mut StdRng::seed_from_u64(seed ^ 0x57A7);
        let direction: f64 = rng.random_range(-3.1..3.1);
        let side = if rng.random::<bool>() { turn } else { -turn };
        let offset = Pose2::new(distance * direction.cos(), distance * direction.sin(), side);
        self.truth * offset
    }
}

/// The bound of a scan from `truth` against scans from `poses`: of the beams that hit what one of
/// the others hit.
pub fn bound(
    scanner: &Scanner,
    world: &RayCaster,
    poses: &[Pose2],
    truth: &Pose2,
) -> Option<Matrix3<f64>> {
    let endpoints = |pose: &Pose2| true_endpoints(scanner, world, pose);
    let seen: Vec<Vector2<f64>> = poses
        .iter()
        .flat_map(|pose| endpoints(pose).into_iter().map(|p| pose.transform(p.position)))
        .collect();
    let known = |p: &CloudPoint| {
        let at = truth.transform(p.position);
        seen.iter().any(|s| (s - at).norm_squared() < SEEN_M * SEEN_M)
    };
    let points = endpoints(truth).into_iter().filter(known).collect();
    let information = fisher_information(&PointCloud { points }, scanner.noise.range_std, 0.0);
    cramer_rao_bound(&information, poses.len())
}

fn true_endpoints(scanner: &Scanner, world: &RayCaster, pose: &Pose2) -> Vec<CloudPoint> {
    let exact = |beam: TrueBeam| {
        let ray = Vector2::new(beam.bearing.cos(), beam.bearing.sin());
        CloudPoint::exact(ray, beam.range, beam.normal)
    };
    scanner.truth(world, pose).into_iter().flatten().map(exact).collect()
}
