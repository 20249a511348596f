//! Takes closures and merges back one after another and compares the map with the one built without
//! them.
//!
//! `cargo run --release -p manifoldslam-slam --example retraction -- ROBOTS RETRACTIONS EVERY SEED`
//!
//! Robots drive 300 m each on a campus. What is taken back is drawn from all closures and relations
//! of merges; a merge goes with all of its relations. Every retraction is timed, from the order to
//! the last pose, in wall-clock time and in CPU time (Linux only); every so-manieth map is compared
//! with that of a team which never had the relations and knows nothing of what was measured before.

use geometry::Pose2;
use manifold::{Provenance, Relation, RelationId};
use manifoldslam_slam::{SlamConfig, Team};
use rand::{Rng, SeedableRng, rngs::StdRng};
use sensing::RobotId;
use std::time::Instant;
use synthetic::{Campus, trajectory_error};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut numbers = std::env::args().skip(1).map(|a| a.parse::<u16>());
    let mut next = |or: u16| numbers.next().unwrap_or(Ok(or));
    let (robots, retractions, every, seed) = (next(18)?, next(200)?, next(20)?, next(1)?);
    let campus = Campus::new(seed.into(), robots);
    let mut team = map(&campus);
    tell_of(&team, &campus);
    let mut rng = StdRng::seed_from_u64(1);
    let (mut wall, mut cpu) = (Vec::new(), Vec::new());
    let (mut merges, mut compared, mut worst) = (0, 0, 0.0f64);
    for count in 1..=retractions {
        let doubtful: Vec<RelationId> =
            team.manifold().active_relations().filter(|r| is_doubtful(r)).map(|r| r.id).collect();
        if doubtful.is_empty() {
            println!("nothing left to retract after {}", count - 1);
            break;
        }
        let drawn = doubtful[rng.random_range(0..doubtful.len())];
        let merge = team.merges().iter().find(|merge| merge.relations.contains(&drawn));
        merges += usize::from(merge.is_some());
        let together = merge.map_or_else(|| vec![drawn], |merge| merge.relations.clone());
        let (start, cpu_before) = (Instant::now(), cpu_secs());
        together.into_iter().for_each(|id| team.retract(id));
        team.rebuild();
        wall.push(start.elapsed().as_secs_f64());
        cpu.push(cpu_secs() - cpu_before);
        if count % every == 0 {
            compared += 1;
            worst = worst.max(difference(&team));
        }
    }
    println!(
        "{} retractions, {merges} of them of merges; {} islands left",
        wall.len(),
        team.manifold().islands().len()
    );
    println!("  wall-clock time: {}", quantiles(wall));
    println!("  CPU time:        {}", quantiles(cpu));
    println!(
        "  {compared} maps compared with those built without: largest difference of a pose \
         {worst:.1e} m or rad"
    );
    Ok(())
}

fn map(campus: &Campus) -> Team {
    let mut team = Team::new(SlamConfig::default());
    for number in 0..campus.robots() {
        let observations = campus.run(number).map(|run| run.observations);
        team.map_robot(&format!("robot-{number:02}"), observations.into_iter().flatten());
    }
    team.finish();
    team
}

fn is_doubtful(relation: &Relation) -> bool {
    relation.provenance != Provenance::Sequential
}

fn tell_of(team: &Team, campus: &Campus) {
    let of = |kind: Provenance| {
        team.manifold().active_relations().filter(|r| r.provenance == kind).count()
    };
    println!(
        "{} robots, {} patches, {} closures, {} relations of merges, {} islands; ATE {:.4} m",
        campus.robots(),
        team.manifold().patches().len(),
        of(Provenance::LoopClosure),
        of(Provenance::Merge),
        team.manifold().islands().len(),
        ate(team, campus)
    );
}

/// Absolute trajectory error of the scans of the first island, metres.
fn ate(team: &Team, campus: &Campus) -> f64 {
    let manifold = team.manifold();
    let islands = manifold.component_map();
    let (mut truth, mut estimate) = (Vec::new(), Vec::new());
    for number in 0..campus.robots() {
        let Some(run) = campus.run(number) else { continue };
        for (pose, truth_pose) in team.scan_poses(RobotId(number)).zip(run.truth) {
            if islands.of(pose.patch) == 0 {
                truth.push(truth_pose);
                estimate.push(pose.in_map(manifold));
            }
        }
    }
    trajectory_error(&truth, &estimate)
}

/// Largest difference between a team's poses and those of the map made, by a team that starts from
/// nothing, of the relations that are left.
fn difference(team: &Team) -> f64 {
    let mut other = team.with_relations(Relation::is_active);
    other.rebuild();
    let apart = |a: &Pose2, b: &Pose2| a.distance(b).max(geometry::wrap_angle(a.yaw - b.yaw).abs());
    let patches = team.manifold().patches().iter().zip(other.manifold().patches());
    let patches = patches.map(|(a, b)| apart(&a.island_from_patch, &b.island_from_patch));
    let robots = (0..team.manifold().robots().len()).map(|k| RobotId(k as u16));
    let scans = robots.flat_map(|robot| {
        let pairs = team.scan_poses(robot).zip(other.scan_poses(robot));
        pairs.map(|(a, b)| apart(&a.patch_from_base, &b.patch_from_base)).collect::<Vec<_>>()
    });
    patches.chain(scans).fold(0.0, f64::max)
}

/// CPU time of this process's threads so far, as Linux tells it; nothing elsewhere.
fn cpu_secs() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanos = threads.filter_map(|thread| {
        let told = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        told.split_whitespace().next()?.parse::<f64>().ok()
    });
    nanos.sum::<f64>() * 1e-9
}

fn quantiles(mut secs: Vec<f64>) -> String {
    secs.sort_by(f64::total_cmp);
    let at = |share: f64| {
        secs.get((secs.len().saturating_sub(1) as f64 * share) as usize).copied().unwrap_or(0.0)
    };
    format!("{:.3} s median, {:.3} s p95, {:.3} s worst", at(0.5), at(0.95), at(1.0))
}
