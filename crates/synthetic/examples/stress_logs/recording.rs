use crate::faults::{Faults, disturb_odometry, drop_gaps, stamps, thin};
use geometry::{LieGroup, Pose2, Vector2};
use manifoldslam_synthetic::{FloorPlan, LaserNoise, RayCaster, WheelNoise, standard_normal};
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::LaserModel;

/// What is driven where, with which sensors, and what goes wrong.
pub struct Scenario {
    pub plan: FloorPlan,
    /// Walls that only show from straight ahead.
    pub glass: FloorPlan,
    /// True base poses at the scans.
    pub truth: Vec<Pose2>,
    pub scan_rate: f64,
    pub beams: u32,
    pub noise: LaserNoise,
    /// What a beam without return reads, metres.
    pub no_return: f64,
    pub base_from_laser: Pose2,
    pub wheels: WheelNoise,
    pub faults: Faults,
    /// Write `ROBOTLASER1` lines, else `FLASER`.
    pub robot_laser: bool,
    pub seed: u64,
}

/// One line of the log with its truth.
pub struct Entry {
    pub stamp_micros: i64,
    pub truth: Pose2,
    pub odometry: Pose2,
    pub readings: Vec<f64>,
}

/// A beam over the half circle takes this long, seconds (SICK LMS: 75 turns a second).
const SWEEP_SECS: f64 = 0.5 / 75.0;
/// Glass shows within this cosine of its normal.
const GLASS_COS: f64 = 0.97;
const PERSON_RADIUS_M: f64 = 0.18;

/// Drives through a scenario.
pub fn record(scenario: &Scenario) -> Vec<Entry> {
    let s = scenario;
    let mut rng = StdRng::seed_from_u64(s.seed ^ 0x57E5);
    let odometry = odometry_of(s, &mut rng);
    let micros = stamps(s.truth.len(), s.scan_rate, s.faults.stamps_back, &mut rng);
    let worlds =
        Worlds { walls: RayCaster::new(s.plan.clone()), glass: RayCaster::new(s.glass.clone()) };
    let crowd = Crowd::new(s);
    let kept = thin(&s.truth, s.faults.sparse);
    let kept = drop_gaps(&kept, s.scan_rate, s.faults.gaps, &mut rng);
    kept.into_iter()
        .map(|i| {
            let people = crowd.around(i);
            let readings = scan(s, &worlds, i, &people, &mut rng);
            let (truth, odometry) = (s.truth[i], odometry[i]);
            Entry { stamp_micros: micros[i], truth, odometry, readings }
        })
        .collect()
}

fn odometry_of(s: &Scenario, rng: &mut StdRng) -> Vec<Pose2> {
    let mut pose = Pose2::IDENTITY;
    let mut poses = vec![pose];
    for pair in s.truth.windows(2) {
        pose = pose * s.wheels.measure(&pair[0].between(&pair[1]), rng);
        poses.push(pose);
    }
    disturb_odometry(&mut poses, &s.faults, rng);
    poses
}

struct Worlds {
    walls: RayCaster,
    glass: RayCaster,
}

/// One sweep, the robot moving on during it as it does between the scans around.
fn scan(
    s: &Scenario,
    worlds: &Worlds,
    index: usize,
    people: &[Vector2<f64>],
    rng: &mut StdRng,
) -> Vec<f64> {
    let next = s.truth[(index + 1).min(s.truth.len() - 1)];
    let velocity = s.truth[index].between(&next).log() * s.scan_rate;
    let laser = LaserModel::half_circle(s.beams);
    (0..s.beams as usize)
        .map(|beam| {
            let time = (beam as f64 / f64::from(s.beams) - 0.5) * SWEEP_SECS;
            let origin = s.truth[index].retract(&(velocity * time)) * s.base_from_laser;
            let bearing = laser.bearing(beam) + s.noise.bearing_std * standard_normal(rng);
            let direction = origin.rotate(Vector2::new(bearing.cos(), bearing.sin()));
            let error = s.noise.range_std * standard_normal(rng);
            let dropped = rng.random::<f64>() < s.noise.dropout;
            let range = worlds.range(origin.translation(), direction, people, s.noise.max_range);
            match range.filter(|_| !dropped) {
                Some(range) => quantise((range + error).max(0.0), s.noise.quantisation),
                None => s.no_return,
            }
        })
        .collect()
}

fn quantise(range: f64, step: f64) -> f64 {
    if step > 0.0 { (range / step).round() * step } else { range }
}

impl Worlds {
    /// Range to the first of wall, glass and person.
    fn range(
        &self,
        origin: Vector2<f64>,
        direction: Vector2<f64>,
        people: &[Vector2<f64>],
        max_range: f64,
    ) -> Option<f64> {
        let wall = self.walls.cast(origin, direction, max_range).map(|hit| hit.range);
        let glass = self
            .glass
            .cast(origin, direction, max_range)
            .filter(|hit| hit.normal.dot(&direction).abs() > GLASS_COS)
            .map(|hit| hit.range);
        let bodies = people.iter().filter_map(|person| {
            let to = person - origin;
            let along = to.dot(&direction);
            let across2 = to.norm_squared() - along * along;
            let inside = PERSON_RADIUS_M * PERSON_RADIUS_M - across2;
            (along > 0.0 && inside > 0.0).then(|| along - inside.sqrt())
        });
        bodies.chain(wall).chain(glass).filter(|&r| r > 0.05).reduce(f64::min)
    }
}

/// People who walk along the robot's way: some lead it, some come towards it.
struct Crowd {
    way: Vec<(f64, Pose2)>,
    people: usize,
    rate: f64,
}

impl Crowd {
    fn new(s: &Scenario) -> Self {
        let mut metres = 0.0;
        let mut way = vec![(0.0, s.truth[0])];
        for pair in s.truth.windows(2) {
            metres += pair[0].distance(&pair[1]);
            way.push((metres, pair[1]));
        }
        Crowd { way, people: s.faults.people, rate: s.scan_rate }
    }

    /// Where they are at a scan.
    fn around(&self, index: usize) -> Vec<Vector2<f64>> {
        let (here, robot) = self.way[index];
        let seconds = index as f64 / self.rate;
        (0..self.people)
            .map(|person| {
                let phase = person as f64 * 7.3;
                let (ahead, across) = if person % 2 == 0 {
                    (2.0 + 1.5 * (0.2 * seconds + phase).sin(), 0.5 * (0.5 * seconds + phase).sin())
                } else {
                    (12.0 - (1.1 * seconds + phase).rem_euclid(20.0), 0.6)
                };
                let at = self.at(here + ahead);
                at.transform(Vector2::new(0.0, across))
            })
            .filter(|at| (at - robot.translation()).norm() > 0.5)
            .collect()
    }

    fn at(&self, metres: f64) -> Pose2 {
        let index = self.way.partition_point(|(m, _)| *m < metres);
        self.way[index.min(self.way.len() - 1)].1
    }
}
