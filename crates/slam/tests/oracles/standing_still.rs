//! The manifold is extended when the fit says so, and only then.

use crate::runs::building;
use manifoldslam_slam::{Mapper, SlamConfig};
use rand::{SeedableRng, rngs::StdRng};
use sensing::{Observation, Stamp};
use synthetic::{LaserNoise, RayCaster, Scanner};

/// `scans` noisy scans from one place, three a second.
fn stand(place: usize, scans: usize, seed: u64) -> impl Iterator<Item = Observation> {
    let run = building();
    let world = RayCaster::new(run.plan.clone());
    let scanner = Scanner::half_circle(181, LaserNoise::default());
    let mut rng = StdRng::seed_from_u64(seed);
    (0..scans).map(move |i| Observation {
        stamp: Stamp::from_secs(i as f64 / 3.0),
        scan: scanner.scan(&world, &run.truth[place], &mut rng),
        ..run.observations[place].clone()
    })
}

#[test]
fn a_robot_that_stands_still_adds_no_patches() {
    for place in [0, 120, 333] {
        let mut mapper = Mapper::new(SlamConfig::default());
        for observation in stand(place, 100, place as u64) {
            mapper.step(observation);
        }
        assert_eq!(mapper.manifold().patches().len(), 1, "at scan {place}");
        mapper.finish();
        let start = mapper.trajectory()[0];
        for pose in mapper.trajectory() {
            let error = start.between(&pose);
            assert!(error.norm() < 0.02 && error.yaw.abs() < 0.005, "{error:?}");
        }
    }
}

#[test]
fn a_robot_that_drives_adds_patches_on_its_way_only() {
    let mapped = crate::runs::mapped_building();
    let patches = mapped.manifold.patches().len() as f64;
    let way = building().path_length();
    println!("{patches} patches over {way:.0} m");
    // Every 0.6 m or half radian; three times that where it turns and where it sees new rooms.
    assert!(patches > way / 1.2 && patches < 3.0 * way / 0.6, "{patches} over {way}");
}
