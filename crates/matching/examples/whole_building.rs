//! Where in a building of about 50 x 50 m was a scan taken? Every heading, nothing known before;
//! and does the answer say so when another place looks the same?
//!
//! `cargo run --release -p manifoldslam-matching --example whole_building -- [PLACES] [SEED]`
//!
//! The building is an office floor of look-alike rooms, half of them empty. Its map is made of
//! noisy scans at true poses. A place is *aliased* when, by the plan and without any noise, nearly
//! all beams measure the same at another place; *clear* when no other place comes near that. In
//! between either answer is right: the place, or "ambiguous".

use geometry::{Pose2, Vector2};
use manifoldslam_matching::{
    CombinedMatcher, CombinedReference, CombinedSettings, LikelihoodPyramid, LikelihoodSettings,
    MatchResult, MatchStatus, NeighbourTree, PointCloud, PointCloudSettings, Prior, SearchSettings,
    SearchWindow,
};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::f64::consts::PI;
use std::time::Instant;
use synthetic::{LaserNoise, RayCaster, Scanner, TrueBeam, office_plan};

/// Blocks to a side: 58 x 50 m.
const BLOCKS: usize = 4;
/// Beams that measure the same within this are explained, metres.
const SAME_RANGE_M: f64 = 0.1;
/// Share of explained beams from which a place is aliased, and below which it is clear.
const ALIASED: f64 = 0.98;
const CLEAR: f64 = 0.85;
/// Share of a place's beams that the map must have seen.
const MAPPED: f64 = 0.95;
/// Answers within this of the truth are right.
const RIGHT_M: f64 = 0.1;
const RIGHT_RAD: f64 = 0.05;

/// The building with its map.
struct Building {
    world: RayCaster,
    scanner: Scanner,
    map: PointCloud,
    map_tree: NeighbourTree,
    /// For finding rivals: finer than the matcher's own.
    table: LikelihoodPyramid,
    window: SearchWindow,
}

/// What came of the places of one kind.
#[derive(Default)]
struct Tally {
    name: &'static str,
    right: usize,
    ambiguous: usize,
    wrong: usize,
    lost: usize,
    times_ms: Vec<f64>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let wanted: usize = arguments.next().map_or(Ok(200), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let building = Building::new(seed);
    let matcher = CombinedMatcher { settings: CombinedSettings::default() };
    let began = Instant::now();
    let reference = matcher.prepare(&building.map, building.window.half_x_m);
    println!("{} points in the map, prepared in {:.0?}", building.map.len(), began.elapsed());
    let rng = &mut StdRng::seed_from_u64(seed ^ 0x000B_1DE5);
    let names = ["clear", "in between", "aliased"];
    let mut tallies = names.map(|name| Tally { name, ..Tally::default() });
    while tallies[0].count() < wanted {
        let place = building.free_place(rng);
        let rival = building.best_rival(&reference, &place);
        let kind = usize::from(rival >= CLEAR) + usize::from(rival >= ALIASED);
        let cloud = cloud(&building.scanner.scan(&building.world, &place, rng));
        let began = Instant::now();
        let found = reference.search(&cloud, &building.window, &Prior::guess(Pose2::IDENTITY));
        tallies[kind].add(&place, &found, began.elapsed().as_secs_f64() * 1e3);
    }
    for tally in &mut tallies {
        tally.print();
    }
    Ok(())
}

impl Building {
    fn new(seed: u64) -> Self {
        let world = RayCaster::new(office_plan(seed, BLOCKS));
        let scanner = Scanner::half_circle(
            361,
            LaserNoise { max_range: 30.0, ..LaserNoise::gaussian(0.015) },
        );
        let (low, high) = world.plan().bounds();
        let rng = &mut StdRng::seed_from_u64(seed ^ 0x3A9);
        let mut map = PointCloud::default();
        // A robot that went everywhere: a stop every two metres, looking to four sides.
        for k in 0..((high.x - low.x) as usize / 2) * ((high.y - low.y) as usize / 2) {
            let columns = (high.x - low.x) as usize / 2;
            let stop =
                Vector2::new(1.0 + 2.0 * (k % columns) as f64, 1.0 + 2.0 * (k / columns) as f64);
            if world.plan().clearance(stop) < 0.3 {
                continue;
            }
            for quarter in 0..4 {
                let pose = Pose2::new(stop.x, stop.y, 0.5 * PI * f64::from(quarter));
                map.extend(&cloud(&scanner.scan(&world, &pose, rng)).transformed(&pose));
            }
        }
        let middle = 0.5 * (low + high);
        let window = SearchWindow {
            centre: Pose2::new(middle.x, middle.y, 0.0),
            half_x_m: 0.5 * (high.x - low.x),
            half_y_m: 0.5 * (high.y - low.y),
            half_yaw_rad: PI,
        };
        let map_tree = NeighbourTree::new(map.points.iter().map(|p| p.position));
        let likelihood = LikelihoodSettings { cell_m: 0.1, sigma_m: 0.1, ..Default::default() };
        let table = LikelihoodPyramid::build(&map, &likelihood);
        Building { world, scanner, map, map_tree, table, window }
    }

    /// A random place with room for a robot, whose surroundings the map knows.
    fn free_place(&self, rng: &mut StdRng) -> Pose2 {
        let (low, high) = self.world.plan().bounds();
        loop {
            let at = Vector2::new(rng.random_range(low.x..high.x), rng.random_range(low.y..high.y));
            let place = Pose2::new(at.x, at.y, rng.random_range(-PI..PI));
            if self.world.plan().clearance(at) > 0.4 && self.mapped(&place) > MAPPED {
                return place;
            }
        }
    }

    /// Share of the beams at a place that hit what the map has seen.
    fn mapped(&self, place: &Pose2) -> f64 {
        let seen = |beam: &Option<TrueBeam>| {
            beam.is_some_and(|beam| {
                let (sin, cos) = beam.bearing.sin_cos();
                let at = place.transform(Vector2::new(cos, sin) * beam.range);
                self.map_tree.nearest(at, SAME_RANGE_M * SAME_RANGE_M).is_some()
            })
        };
        let beams = self.scanner.truth(&self.world, place);
        beams.iter().filter(|beam| seen(beam)).count() as f64 / beams.len() as f64
    }

    /// The largest share of beams that measure the same at another place, by the plan and without
    /// noise.
    fn best_rival(&self, reference: &CombinedReference<'_>, place: &Pose2) -> f64 {
        let perfect =
            Scanner { noise: LaserNoise { max_range: 30.0, ..LaserNoise::NONE }, ..self.scanner };
        let scan = perfect.scan(&self.world, place, &mut StdRng::seed_from_u64(0));
        let truth = perfect.truth(&self.world, place);
        let settings = SearchSettings {
            min_score: 0.5,
            candidates: 200,
            separation_m: 0.5,
            separation_rad: 0.5,
            below_best: 0.15,
            max_windows: 3_000_000,
        };
        let cloud = cloud(&scan);
        let points: Vec<Vector2<f32>> =
            cloud.points.iter().step_by(3).map(|p| p.position.cast()).collect();
        let candidates = self.table.search_many(&points, &self.window, &settings).candidates;
        let agreement = |found: MatchResult| {
            let there = perfect.truth(&self.world, &found.pose);
            let same = truth.iter().zip(&there).filter(|(a, b)| match (a, b) {
                (Some(a), Some(b)) => {
                    // Across the surface: where a beam grazes a wall, its range tells little.
                    let (sin, cos) = a.bearing.sin_cos();
                    let facing = a.normal.dot(&Vector2::new(cos, sin)).abs();
                    (a.range - b.range).abs() * facing < SAME_RANGE_M
                }
                (None, None) => true,
                _ => false,
            });
            same.count() as f64 / truth.len() as f64
        };
        candidates
            .iter()
            .map(|candidate| reference.align(&cloud, &Prior::guess(candidate.pose)))
            .filter(|found| !near(&found.pose, place, 0.3, 0.2))
            .map(agreement)
            .fold(0.0, f64::max)
    }
}

impl Tally {
    fn count(&self) -> usize {
        self.right + self.ambiguous + self.wrong + self.lost
    }

    fn add(&mut self, place: &Pose2, found: &MatchResult, time_ms: f64) {
        self.times_ms.push(time_ms);
        let right = near(&found.pose, place, RIGHT_M, RIGHT_RAD);
        match found.status {
            MatchStatus::Ambiguous { .. } => self.ambiguous += 1,
            MatchStatus::Converged | MatchStatus::Degenerate { .. } if right => self.right += 1,
            MatchStatus::Converged | MatchStatus::Degenerate { .. } => self.wrong += 1,
            MatchStatus::TooFewPoints | MatchStatus::Diverged => self.lost += 1,
        }
    }

    fn print(&mut self) {
        self.times_ms.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let last = self.times_ms.len().saturating_sub(1) as f64;
            self.times_ms.get((share * last) as usize).copied().unwrap_or(f64::NAN)
        };
        println!(
            "{:10}: {} places: {} right, {} ambiguous, {} wrong, {} not found; median {:.1} ms, \
             95 % {:.1} ms, worst {:.1} ms",
            self.name,
            self.count(),
            self.right,
            self.ambiguous,
            self.wrong,
            self.lost,
            at(0.5),
            at(0.95),
            at(1.0)
        );
    }
}

fn near(a: &Pose2, b: &Pose2, metres: f64, radians: f64) -> bool {
    a.distance(b) < metres && geometry::wrap_angle(a.yaw - b.yaw).abs() < radians
}

fn cloud(scan: &sensing::Scan) -> PointCloud {
    PointCloud::from_scan(scan, &Pose2::IDENTITY, &PointCloudSettings::default())
}
