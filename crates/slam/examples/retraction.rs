//! Takes closures and merges back one after another and compares the map with the one built without
//! them.
//!
//! `cargo run --release -p manifoldslam-slam --example retraction -- ROBOTS BLOCKS RETRACTIONS`
//!
//! Robots drive the corridors of one office floor of BLOCKS x BLOCKS blocks, each with noise of its
//! own. Every retraction is timed, from the order to the last pose; every so-manieth map is
//! compared with that of a team which never had the relations.

use manifold::RelationId;
use manifoldslam_slam::{SlamConfig, Team};
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::time::Instant;
use synthetic::{Robot, office};

/// Maps are compared after so many retractions.
const COMPARED_EVERY: usize = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut numbers = std::env::args().skip(1).map(|a| a.parse::<usize>());
    let mut next = |or: usize| numbers.next().unwrap_or(Ok(or));
    let (robots, blocks, retractions) = (next(2)?, next(3)?, next(200)?);
    let mut team = Team::new(SlamConfig::default());
    for robot in 0..robots {
        let run = office(7, blocks, &Robot::default());
        let observations = run.observations.into_iter().skip(robot * 40);
        team.map_robot(&format!("robot-{robot}"), observations);
    }
    team.finish();
    let (patches, islands) = (team.manifold().patches().len(), team.manifold().islands().len());
    println!("{robots} robots, {patches} patches, {islands} islands");
    let mut rng = StdRng::seed_from_u64(1);
    let (mut times, mut worst) = (Vec::new(), 0.0f64);
    for count in 1..=retractions {
        let doubtful: Vec<RelationId> = team
            .manifold()
            .active_relations()
            .filter(|r| r.provenance != manifold::Provenance::Sequential)
            .map(|r| r.id)
            .collect();
        if doubtful.is_empty() {
            println!("nothing left to retract after {}", count - 1);
            break;
        }
        let start = Instant::now();
        team.retract(doubtful[rng.random_range(0..doubtful.len())]);
        team.rebuild();
        times.push(start.elapsed().as_secs_f64());
        if count % COMPARED_EVERY == 0 {
            worst = worst.max(difference(&team));
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{} retractions: {:.3} s median, {:.3} s worst; largest difference from the map built \
         without them {worst:.1e} m; {} islands left",
        times.len(),
        at(0.5),
        at(1.0),
        team.manifold().islands().len()
    );
    Ok(())
}

/// Largest distance between patches of a team's map and of the map made of the relations that are
/// left alone.
fn difference(team: &Team) -> f64 {
    let mut other = team.with_relations(manifold::Relation::is_active);
    other.rebuild();
    let pairs = team.manifold().patches().iter().zip(other.manifold().patches());
    let apart = pairs.map(|(a, b)| a.island_from_patch.distance(&b.island_from_patch));
    apart.fold(0.0, f64::max)
}
