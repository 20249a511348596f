//! Maps robots in look-alike places and counts the islands that come out against the truth.
//!
//! `cargo run --release -p manifoldslam-slam --example twins -- FIRST_SEED COUNT`
//!
//! A false merge is an island that holds robots of two buildings. A merge is missed when one
//! building's robots are on several islands; with three robots that also happens where two of
//! them are apart in truth. What was merged wrongly or not at all is told with its evidence.

use manifold::{Change, PatchId};
use manifoldslam_slam::{Event, Mapper, SlamConfig, Team};
use synthetic::{Meeting, TwinCase, TwinFamily, twins};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> =
        std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let &[first, count] = &numbers[..] else { return Err("arguments: FIRST_SEED COUNT".into()) };
    println!("family      truth  cases  right  false merges  missed");
    for family in TwinFamily::ALL {
        for meeting in [Meeting::Apart, Meeting::Together] {
            let (mut right, mut wrong, mut missed) = (0, 0, 0);
            for seed in first..first + count {
                let case = twins(family, seed, meeting);
                let team = mapped(&case);
                let (mixed, islands) = islands(&team, &case);
                wrong += usize::from(mixed);
                missed += usize::from(islands > case.true_islands);
                right += usize::from(!mixed && islands == case.true_islands);
                if mixed {
                    tell(&case, seed, &team);
                }
            }
            let truth = if meeting == Meeting::Apart { 2 } else { 1 };
            let name = family.name();
            println!("{name:10}  {truth:5}  {count:5}  {right:5}  {wrong:12}  {missed:6}");
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
    let config = SlamConfig::default();
    let mut team = Team::new(config);
    for (number, run) in case.runs.iter().enumerate() {
        let robot = team.add_robot(&format!("robot-{number}"));
        let mut mapper = Mapper::new(config);
        for observation in &run.observations {
            let events = mapper.step(observation.clone());
            let changes: Vec<Change> = events.into_iter().filter_map(change).collect();
            team.receive(robot, &changes);
        }
        mapper.conclude();
        team.join(robot, mapper);
    }
    team.merge();
    team
}

fn change(event: Event) -> Option<Change> {
    match event {
        Event::Map(change) => Some(change),
        Event::Localised(..) => None,
    }
}

/// Whether an island holds robots of two buildings, and how many islands there are.
fn islands(team: &Team, case: &TwinCase) -> (bool, usize) {
    let islands = team.manifold().islands();
    let building = |p: PatchId| case.buildings[usize::from(team.manifold().patch(p).robot.0)];
    let is_mixed =
        |island: &Vec<PatchId>| island.iter().any(|&p| building(p) != building(island[0]));
    (islands.iter().any(is_mixed), islands.len())
}
