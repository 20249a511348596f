//! Maps robots in look-alike places and counts the islands that come out against the truth.
//!
//! `cargo run --release -p manifoldslam-slam --example twins -- FIRST_SEED COUNT [FAMILY [TRUTH]]`
//!
//! FAMILY is rooms, corridors or mirrored, TRUTH is 2 for robots in two buildings and 1 for one;
//! all of them where nothing is said. A false merge is an island that holds robots of two
//! buildings, or of one in the wrong places: a relation between two robots that is off by more than
//! a metre or a tenth of a radian. A merge is missed when one building's robots are on several
//! islands. Of the missed cases those are counted besides (alike only) in which a robot has less
//! than five metres of way in common with any other one beyond the part that the other building has
//! too: nothing that they passed twice says which of the two it was. (Mirrored buildings are that
//! part all over; they are not counted.) What was merged wrongly is told with its evidence.

use geometry::Pose2;
use manifold::{Patch, PatchId};
use manifoldslam_slam::{SlamConfig, Team};
use std::collections::BTreeMap;
use synthetic::{Meeting, TwinCase, TwinFamily, twins};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [first, count, only @ ..] = &arguments[..] else {
        return Err("arguments: FIRST_SEED COUNT [FAMILY [TRUTH]]".into());
    };
    let (first, count): (u64, u64) = (first.parse()?, count.parse()?);
    let wanted = |name: &str, at: usize| only.get(at).is_none_or(|o| o == name);
    println!("family      truth  cases  right  false merges  missed  alike only");
    for family in TwinFamily::ALL {
        for meeting in [Meeting::Apart, Meeting::Together] {
            let truth = if meeting == Meeting::Apart { 2 } else { 1 };
            let name = family.name();
            if !wanted(name, 0) || !wanted(&truth.to_string(), 1) {
                continue;
            }
            let (mut right, mut wrong, mut missed, mut alike) = (0, 0, 0, 0);
            for seed in first..first + count {
                let case = twins(family, seed, meeting);
                let team = mapped(&case);
                let (mixed, islands) = islands(&team, &case);
                let is_false = mixed || is_misplaced(&team, &case);
                wrong += usize::from(is_false);
                missed += usize::from(islands > case.true_islands);
                alike += usize::from(islands > case.true_islands && share_what_is_alike(&case));
                right += usize::from(!is_false && islands == case.true_islands);
                if is_false {
                    tell(&case, seed, &team);
                }
            }
            println!(
                "{name:10}  {truth:5}  {count:5}  {right:5}  {wrong:12}  {missed:6}  {alike:10}"
            );
        }
    }
    Ok(())
}

/// A false merge, to be looked into.
fn tell(case: &TwinCase, seed: u64, team: &Team) {
    println!("  FALSE: {} seed {seed}, exact copy: {}", case.family.name(), case.part.exact);
    for m in team.merges() {
        println!("    {:?} {:?} {:?} {:.1e}", m.robots, m.state, m.evidence, m.false_bound);
    }
}

fn mapped(case: &TwinCase) -> Team {
    let mut team = Team::new(SlamConfig::default());
    for (number, run) in case.runs.iter().enumerate() {
        team.map_robot(&format!("robot-{number}"), run.observations.iter().cloned());
    }
    team.finish();
    team
}

/// Whether an island holds robots of two buildings, and how many islands there are.
fn islands(team: &Team, case: &TwinCase) -> (bool, usize) {
    let islands = team.manifold().islands();
    let building = |p: PatchId| case.buildings[usize::from(team.manifold().patch(p).robot.0)];
    let is_mixed =
        |island: &Vec<PatchId>| island.iter().any(|&p| building(p) != building(island[0]));
    (islands.iter().any(is_mixed), islands.len())
}

/// Ways are in common where they are this near to each other, metres.
const COMMON_M: f64 = 2.0;
/// A common way of less beyond the part that looks alike is none, metres.
const BEYOND_M: usize = 5;

/// Whether a robot of a building has next to nothing in common with any other one of it but the
/// part that looks alike, which the other building has too.
fn share_what_is_alike(case: &TwinCase) -> bool {
    if case.family == TwinFamily::Mirrored {
        return false;
    }
    let robots = 0..case.runs.len();
    let alone = |a: usize| {
        let others = robots.clone().filter(|&b| b != a && case.buildings[b] == case.buildings[a]);
        others.clone().count() > 0 && others.clone().all(|b| common_beyond(case, a, b) < BEYOND_M)
    };
    robots.clone().any(alone)
}

/// How long the way of a robot is that another one drove too and that is not in the part that looks
/// alike, metres.
fn common_beyond(case: &TwinCase, robot: usize, other: usize) -> usize {
    let building = case.buildings[robot];
    let building_from_world = case.part.world_from_building[building].inverse();
    let (start, end) = case.part.along[building];
    let mut way: Vec<Pose2> = Vec::new();
    for pose in &case.runs[robot].truth {
        if way.last().is_none_or(|last| last.distance(pose) >= 1.0) {
            way.push(*pose);
        }
    }
    let is_beyond = |pose: &&Pose2| {
        let x = (building_from_world * **pose).x;
        x < start || x > end
    };
    let is_common =
        |pose: &&Pose2| case.runs[other].truth.iter().any(|p| p.distance(pose) < COMMON_M);
    way.iter().filter(is_beyond).filter(is_common).count()
}

/// Whether a relation between robots contradicts the truth.
fn is_misplaced(team: &Team, case: &TwinCase) -> bool {
    let mut truth = BTreeMap::new();
    for (number, run) in case.runs.iter().enumerate() {
        let stamps = run.observations.iter().map(|o| (number as u16, o.stamp));
        truth.extend(stamps.zip(run.truth.iter().copied()));
    }
    let manifold = team.manifold();
    let mut crossing = manifold.active_relations().filter_map(|r| {
        let (from, to) = (manifold.patch(r.from), manifold.patch(r.to));
        (from.robot != to.robot).then_some((r, from, to))
    });
    crossing.any(|(r, from, to)| {
        let pose = |patch: &Patch| truth.get(&(patch.robot.0, patch.stamp));
        let (Some(from), Some(to)) = (pose(from), pose(to)) else { return true };
        let error = from.between(to).between(&r.from_from_to.mean);
        error.norm() > 1.0 || error.yaw.abs() > 0.1
    })
}
