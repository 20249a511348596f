use crate::wing::between;
use crate::{RayCaster, Robot, Run, office, standard_normal, two_loop_building_with};
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::{LaserModel, Scan};
use std::ops::Range;

/// What happens to a robot so that its data go bad.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mishap {
    /// Nothing: for comparison.
    None,
    /// It is carried 10 to 30 m away while odometry says that it stands.
    Carried,
    /// It turns over and lies on its back: the laser sees the mirror image of the place, the wheels
    /// turn in the air.
    OnItsBack,
    /// It falls on its side: the laser sees a slice of the room from floor to ceiling, the wheels
    /// turn in the air.
    OnItsSide,
    /// For a while something hangs before the laser, 12 cm away; the robot drives on.
    Covered,
    /// For a while the laser reports nothing at all; the robot drives on.
    Dead,
}

impl Mishap {
    /// All of them, nothing first.
    pub const ALL: [Mishap; 6] = [
        Mishap::None,
        Mishap::Carried,
        Mishap::OnItsBack,
        Mishap::OnItsSide,
        Mishap::Covered,
        Mishap::Dead,
    ];

    /// The name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Mishap::None => "none",
            Mishap::Carried => "carried",
            Mishap::OnItsBack => "on-its-back",
            Mishap::OnItsSide => "on-its-side",
            Mishap::Covered => "covered",
            Mishap::Dead => "dead",
        }
    }
}

/// A run in which data go bad.
#[derive(Clone, Debug, PartialEq)]
pub struct MishapRun {
    /// What was recorded, with the true poses.
    pub run: Run,
    /// The scans that are of no use, by their indices; for [`Mishap::Carried`] the empty range
    /// before the first scan at the other place.
    pub bad: Range<usize>,
}

/// How long a laser is covered or dead, seconds.
const AWAY_SECS: f64 = 20.0;
/// A carried robot drives on for at least so many scans.
const DRIVEN_ON: usize = 200;
/// How far it is carried, metres.
const CARRIED_M: (f64, f64) = (10.0, 30.0);

/// A drive through the demo's building or a floor of look-alike offices, by turns, in which
/// something happens to the robot.
pub fn mishap(kind: Mishap, seed: u64) -> MishapRun {
    let rng = &mut StdRng::seed_from_u64(seed ^ 0x0BAD_DA7A);
    let robot = Robot::default();
    let run = match seed % 2 {
        0 => two_loop_building_with(seed, &robot),
        _ => office(seed, 2, &robot),
    };
    let scans = run.truth.len();
    let at = (between(rng, (0.35, 0.6)) * scans as f64) as usize;
    let end = (at + (AWAY_SECS * robot.drive.scan_rate) as usize).min(scans);
    match kind {
        Mishap::None => MishapRun { run, bad: scans..scans },
        Mishap::Carried => carried(run, &robot, at, rng),
        Mishap::OnItsBack => fallen(run, 2 * scans / 3, |scan, _| mirrored(scan), rng),
        Mishap::OnItsSide => {
            let slice = |scan: &Scan, rng: &mut StdRng| on_its_side(scan.laser(), rng);
            fallen(run, 2 * scans / 3, slice, rng)
        }
        Mishap::Covered => {
            let covered = |laser: &LaserModel, rng: &mut StdRng| {
                let reading = |_| (0.12 + 0.005 * standard_normal(rng)) as f32;
                (0..laser.beams).map(reading).collect::<Vec<_>>()
            };
            blinded(run, at..end, covered, rng)
        }
        Mishap::Dead => blinded(run, at..end, |laser, _| vec![0.0; laser.beams as usize], rng),
    }
}

/// Drives to scan `at`, and on from another place of the same way, seen anew.
fn carried(run: Run, robot: &Robot, at: usize, rng: &mut StdRng) -> MishapRun {
    let from = run.truth[at - 1];
    let far = |i: &usize| (CARRIED_M.0..CARRIED_M.1).contains(&from.distance(&run.truth[*i]));
    let places: Vec<usize> = (0..run.truth.len().saturating_sub(DRIVEN_ON)).filter(far).collect();
    let to = places[rng.random_range(0..places.len())];
    let world = RayCaster::new(run.plan.clone());
    let mut other = run.clone();
    let (mut truth, mut observations) = (run.truth[..at].to_vec(), run.observations[..at].to_vec());
    let Some(stands) = observations[at - 1].odom_from_base else { unreachable!("wheels count") };
    let began = other.observations[to].odom_from_base;
    let secs = run.observations[1].stamp.0 - run.observations[0].stamp.0;
    for (pose, seen) in other.truth[to..].iter().zip(&mut other.observations[to..]) {
        seen.scan = robot.scanner.scan(&world, pose, rng);
        let driven = began.zip(seen.odom_from_base).map(|(began, now)| began.between(&now));
        seen.odom_from_base = driven.map(|driven| stands * driven);
        seen.stamp.0 = observations[observations.len() - 1].stamp.0 + secs;
        truth.push(*pose);
        observations.push(seen.clone());
    }
    MishapRun { run: Run { plan: run.plan, truth, observations }, bad: at..at }
}

/// The robot lies where it is from scan `at` on and sees what `seen` makes of the scan it would
/// have taken there; its wheels turn on as they did.
fn fallen(
    mut run: Run,
    at: usize,
    seen: impl Fn(&Scan, &mut StdRng) -> Scan,
    rng: &mut StdRng,
) -> MishapRun {
    let scans = run.truth.len();
    let world = RayCaster::new(run.plan.clone());
    let scanner = Robot::default().scanner;
    for i in at..scans {
        run.truth[i] = run.truth[at - 1];
        let upright = scanner.scan(&world, &run.truth[i], rng);
        run.observations[i].scan = seen(&upright, rng);
    }
    MishapRun { run, bad: at..scans }
}

/// The scan of a laser turned half round about its forward axis.
fn mirrored(scan: &Scan) -> Scan {
    let nothing = scan.laser().range_max_m + 1.0;
    let readings = (0..scan.len()).rev().map(|i| scan.hit(i).unwrap_or(nothing));
    Scan::classify(*scan.laser(), &readings.collect::<Vec<f32>>())
}

/// What a laser sees whose plane stands on edge: floor on one side, ceiling on the other, a wall
/// ahead.
fn on_its_side(laser: &LaserModel, rng: &mut StdRng) -> Scan {
    const FLOOR_M: f64 = 0.25;
    const CEILING_M: f64 = 2.2;
    const WALL_M: f64 = 3.0;
    let reading = |beam: usize| {
        let (sin, cos) = laser.bearing(beam).sin_cos();
        let across = if sin < 0.0 { FLOOR_M / -sin } else { CEILING_M / sin };
        (across.min(WALL_M / cos.max(1e-9)) + 0.015 * standard_normal(rng)) as f32
    };
    let readings: Vec<f32> = (0..laser.beams as usize).map(reading).collect();
    Scan::classify(*laser, &readings)
}

/// The laser reads what `readings` says for some scans.
fn blinded(
    mut run: Run,
    bad: Range<usize>,
    readings: impl Fn(&LaserModel, &mut StdRng) -> Vec<f32>,
    rng: &mut StdRng,
) -> MishapRun {
    for seen in &mut run.observations[bad.clone()] {
        let laser = *seen.scan.laser();
        seen.scan = Scan::classify(laser, &readings(&laser, rng));
    }
    MishapRun { run, bad }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_happened_is_where_it_says() {
        for seed in 0..4 {
            let fine = mishap(Mishap::None, seed);
            for kind in Mishap::ALL {
                let case = mishap(kind, seed);
                assert_eq!(case.run.truth.len(), case.run.observations.len());
                let same = case.run.observations.iter().zip(&fine.run.observations);
                let first = same.take_while(|(a, b)| a == b).count();
                assert_eq!(first, case.bad.start, "{}", kind.name());
                assert_eq!(case, mishap(kind, seed));
            }
        }
    }

    #[test]
    fn odometry_knows_nothing_of_being_carried() {
        for seed in 0..6 {
            let MishapRun { run, bad } = mishap(Mishap::Carried, seed);
            let at = bad.start;
            let far = run.truth[at - 1].distance(&run.truth[at]);
            assert!((CARRIED_M.0..CARRIED_M.1).contains(&far), "{far}");
            let odom = |i: usize| run.observations[i].odom_from_base.unwrap();
            assert!(odom(at - 1).distance(&odom(at)) < 1e-12);
            assert!(run.truth.len() - at >= DRIVEN_ON);
            for i in at + 1..run.truth.len() {
                let told = odom(i - 1).between(&odom(i)).norm();
                let driven = run.truth[i - 1].distance(&run.truth[i]);
                assert!((told - driven).abs() < 0.05, "{told} {driven}");
            }
        }
    }

    #[test]
    fn a_robot_on_its_back_sees_left_on_the_right() {
        let MishapRun { run, bad } = mishap(Mishap::OnItsBack, 2);
        let scanner = Robot::default().scanner;
        let upright = scanner.truth(&RayCaster::new(run.plan.clone()), &run.truth[bad.start]);
        let seen = &run.observations[bad.start].scan;
        let last = seen.len() - 1;
        let fits = (0..seen.len()).filter(|&i| match (seen.hit(i), upright[last - i]) {
            (Some(range), Some(beam)) => (f64::from(range) - beam.range).abs() < 0.2,
            _ => false,
        });
        assert!(fits.count() * 10 > seen.len() * 9);
    }
}
