use crate::campus_site::{CampusBuilding, CampusSite};
use crate::wing::between;
use crate::{LaserNoise, RayCaster, Robot, Run, Scanner, WheelNoise};
use rand::{Rng, SeedableRng, rngs::StdRng};

/// A campus of buildings joined by passages, and a team that drives it: what scale is measured on.
///
/// Every robot has a building of its own, begins in it, and goes on to two neighbours', through
/// each from end to end. So robots overlap with their neighbours, and with no one else; the ground
/// covered by each is the same however many there are.
#[derive(Clone, Debug)]
pub struct Campus {
    world: RayCaster,
    robots: Vec<Driver>,
}

/// A robot with its way.
#[derive(Clone, Debug)]
struct Driver {
    robot: Robot,
    waypoints: Vec<(f64, f64)>,
    noise_seed: u64,
}

impl Campus {
    /// Length of each robot's way, metres: at least this, and some metres more at most.
    const WAY_M: f64 = 300.0;
    /// Of that what a robot drives in a neighbour's building, from end to end included.
    const VISIT_M: f64 = 55.0;

    /// Draws the campus and what each of its robots, one at least, does.
    pub fn new(seed: u64, robots: u16) -> Self {
        let site = CampusSite::new(seed, usize::from(robots));
        let driver = |number: usize| {
            let rng = &mut StdRng::seed_from_u64(seed ^ ((number as u64 + 1) << 32));
            let route = route(&site, number, rng);
            Driver {
                robot: random_robot(rng),
                waypoints: site.site.waypoints(rng, &route),
                noise_seed: rng.random(),
            }
        };
        let robots = (0..site.buildings.len()).map(driver).collect();
        Campus { world: RayCaster::new(site.site.plan), robots }
    }

    /// How many robots drive.
    pub fn robots(&self) -> u16 {
        self.robots.len() as u16
    }

    /// What a robot, counted from 0, recorded, with its truth in the frame of the campus. `None`
    /// where there is no such robot.
    pub fn run(&self, number: u16) -> Option<Run> {
        let Driver { robot, waypoints, noise_seed } = self.robots.get(usize::from(number))?;
        Some(Run::record_in(&self.world, robot, waypoints, *noise_seed).of_robot(number))
    }
}

/// Through one's own building, about in it, and on through those of two neighbours.
fn route(site: &CampusSite, number: usize, rng: &mut StdRng) -> Vec<usize> {
    let ways = &site.site;
    let visits: Vec<&CampusBuilding> = site.neighbours(number).into_iter().take(2).collect();
    let own = &site.buildings[number];
    let mut there = ways.shortest(own.ends.0, own.ends.1);
    let transit = visits.len() as f64 * (Campus::VISIT_M + TRANSIT_M);
    let rest = Campus::WAY_M - ways.length(&there) - transit;
    wander(site, own, rest, &mut there, rng);
    for (k, building) in visits.iter().enumerate() {
        let here = there[there.len() - 1];
        let [to_first, to_second] =
            [building.ends.0, building.ends.1].map(|end| ways.shortest(here, end));
        let first_is_nearer = ways.length(&to_first) <= ways.length(&to_second);
        let (near, far) = if first_is_nearer {
            (to_first, building.ends.1)
        } else {
            (to_second, building.ends.0)
        };
        there.extend_from_slice(&near[1..]);
        let through = ways.shortest(there[there.len() - 1], far);
        let mut metres = Campus::VISIT_M - ways.length(&through);
        there.extend_from_slice(&through[1..]);
        if k + 1 == visits.len() {
            metres = Campus::WAY_M - ways.length(&there);
        }
        wander(site, building, metres, &mut there, rng);
    }
    there
}

/// About what a robot drives between two buildings, metres.
const TRANSIT_M: f64 = 50.0;

fn wander(
    site: &CampusSite,
    building: &CampusBuilding,
    metres: f64,
    route: &mut Vec<usize>,
    rng: &mut StdRng,
) {
    let start = route[route.len() - 1];
    let more = site.site.wander(rng, start, metres, |stop| building.stops.contains(&stop));
    route.extend_from_slice(&more[1..]);
}

/// Lasers of 181 beams and 25 to 40 m, good to middling wheels.
fn random_robot(rng: &mut StdRng) -> Robot {
    let noise = LaserNoise { max_range: between(rng, (25.0, 40.0)), ..LaserNoise::default() };
    let ordinary = WheelNoise::default();
    let wheels = WheelNoise {
        yaw_per_metre: ordinary.yaw_per_metre * between(rng, (0.5, 1.5)),
        yaw_drift: ordinary.yaw_drift * between(rng, (-2.0, 2.0)),
        yaw_scale: ordinary.yaw_scale * between(rng, (-2.0, 2.0)),
        ..ordinary
    };
    Robot { scanner: Scanner::half_circle(181, noise), wheels, ..Robot::default() }
}
