//! From observations to a map: a synthetic building, the pipeline, the trajectory, an image.
//!
//! `cargo run --release -p manifoldslam --example 01_map_a_synthetic_building`

use geometry::Pose2;
use rendering::{
    Annotations, CastSettings, Cell, GridFrame, HitMissCounts, OccupancyGrid, OccupancyRule,
    ScanView, Trajectory, map_png,
};
use slam::{Event, Mapper, SlamConfig};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. A robot drives through two loops of corridor. Its wheels count badly; its laser has noise.
    //    The seed decides everything: the same seed, the same bytes.
    let run = synthetic::two_loop_building(1);
    println!("{} scans along {:.0} m", run.observations.len(), run.path_length());

    // 2. One observation in, events out. The mapper never reads a file or a clock.
    let mut mapper = Mapper::new(SlamConfig::default());
    let mut patches_announced = 0;
    for observation in &run.observations {
        for event in mapper.step(observation.clone()) {
            if matches!(event, Event::Map(manifold::Change::PatchAdded(_))) {
                patches_announced += 1;
            }
        }
    }
    // 3. The global pass refits the map and places every scan in it.
    mapper.finish();
    let statistics = mapper.statistics();
    println!(
        "{} patches, {} of {} closures accepted",
        statistics.patches, statistics.closures.accepted, statistics.closures.tried
    );
    assert_eq!(patches_announced, mapper.manifold().patches().len());
    assert_eq!(mapper.manifold().islands().len(), 1, "one robot that never got lost: one island");

    // 4. Every scan has a pose, not only the patches. The map's frame is that of the first scan, so
    //    the truth is looked at from there; odometry begins there by itself. (How well the first
    //    scan's own pose is known is thus part of the error; `eval ate` aligns first.)
    let trajectory = mapper.trajectory();
    assert_eq!(trajectory.len(), run.truth.len());
    let truth = run.truth.iter().map(|pose| run.truth[0].between(pose));
    let ours = mean_error(trajectory.iter().copied(), truth.clone());
    let odometry = run.observations.iter().filter_map(|seen| seen.odom_from_base);
    let wheels = mean_error(odometry, truth);
    println!("mean error {ours:.3} m; by the wheels alone {wheels:.2} m");
    assert!(ours < 0.1 && ours < 0.1 * wheels);

    // 5. Patches become an image: cast their beams, decide what is wall, draw.
    let views: Vec<ScanView> = mapper
        .manifold()
        .patches()
        .iter()
        .map(|patch| ScanView {
            map_from_laser: patch.island_from_patch * patch.base_from_laser,
            scan: &patch.scan,
        })
        .collect();
    let frame = GridFrame::around(&views, 1.0, 0.05)?;
    let counts = HitMissCounts::cast(frame, &views, &CastSettings::default())?;
    let grid = OccupancyGrid::decide(&counts, &OccupancyRule::default());
    let path = [Trajectory { name: "robot", poses: &trajectory }];
    let png = map_png(&grid, &Annotations { trajectories: &path, ..Annotations::default() })?;
    let square_metres = grid.count(Cell::Free) as f64 * frame.resolution_m.powi(2);
    println!("{square_metres:.0} m2 of free space in a PNG of {} kB", png.len() / 1000);
    assert!(png.starts_with(b"\x89PNG") && square_metres > 200.0);
    Ok(())
}

fn mean_error(poses: impl Iterator<Item = Pose2>, truth: impl Iterator<Item = Pose2>) -> f64 {
    let errors: Vec<f64> = poses.zip(truth).map(|(pose, truth)| pose.distance(&truth)).collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}
