//! Teams on a campus: nobody drives through a wall, everybody's way is as long as everybody's, and
//! every robot is linked to every other by ground that neighbours share.

use crate::teams::assert_clear;
use manifoldslam_synthetic as synthetic;
use synthetic::{Campus, RayCaster, Run};

fn runs(seed: u64, robots: u16) -> Vec<Run> {
    let campus = Campus::new(seed, robots);
    assert_eq!(campus.robots(), robots.max(1));
    assert!(campus.run(campus.robots()).is_none());
    (0..campus.robots()).filter_map(|number| campus.run(number)).collect()
}

#[test]
fn robots_drive_about_300_m_clear_of_walls() {
    for (seed, robots) in [(1, 1), (4, 9)] {
        for (number, run) in runs(seed, robots).iter().enumerate() {
            let name = format!("seed {seed}, robot {number} of {robots}");
            assert_clear(run, &RayCaster::new(run.plan.clone()), &name);
            // Corners are cut, and a room begun is left again.
            assert!((270.0..360.0).contains(&run.path_length()), "{name}: {}", run.path_length());
        }
    }
}

/// Metres of a run's way that another run passes within a metre of.
fn shared_m(run: &Run, other: &Run) -> f64 {
    let near = |i: usize| other.truth.iter().any(|pose| pose.distance(&run.truth[i]) < 1.0);
    let steps = run.truth.windows(2).enumerate().filter(|(i, _)| near(*i));
    steps.map(|(_, pair)| pair[0].distance(&pair[1])).sum()
}

#[test]
fn shared_ground_links_all_robots() {
    for (seed, robots) in [(1, 2), (2, 7)] {
        let runs = runs(seed, robots);
        let mut reached = vec![0];
        let mut next = 0;
        while let Some(&from) = reached.get(next) {
            next += 1;
            for to in 0..runs.len() {
                // About a building from end to end.
                if !reached.contains(&to) && shared_m(&runs[from], &runs[to]) > 30.0 {
                    reached.push(to);
                }
            }
        }
        assert_eq!(reached.len(), runs.len(), "seed {seed}");
    }
}

#[test]
fn a_campus_is_a_function_of_its_seed() {
    let [one, again, other] = [8, 8, 9].map(|seed| Campus::new(seed, 3).run(2));
    assert!(one.is_some() && one == again && one != other);
}
