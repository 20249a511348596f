//! What the tests share: folders, and sites with everything in them.

use geometry::{GaussianPose2, Matrix2, Matrix3, Pose2, Vector2};
use manifold::{
    Climb, Elevation, Manifold, Patch, PatchId, PatchSighting, Provenance, RelationId, Retraction,
    Way,
};
use manifoldslam_store::{
    ObservationBlock, RobotLog, Site, Step, TakenScan, TrackedScan, same_map,
};
use sensing::{Attitude, LandmarkKind, LaserModel, RobotId, Scan, Sighting, Stamp, Sweep, Twist};
use std::path::PathBuf;
use std::sync::Arc;

/// A folder of one test, removed at its end.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(name: &str) -> Self {
        let name = format!("manifoldslam-store-{name}-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Names of everything in the folder.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> =
            entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Numbers without a pattern, the same for the same index.
pub fn noise(index: usize, salt: usize) -> f64 {
    let mixed = (index as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(salt as u32 * 7);
    (mixed.wrapping_mul(0xD6E8_FEB8_6659_FD93) >> 11) as f64 / (1u64 << 53) as f64
}

pub fn some_pose(index: usize) -> Pose2 {
    Pose2::new(9.0 * noise(index, 1), -5.0 * noise(index, 2), 6.0 * noise(index, 3) - 3.0)
}

pub fn some_gaussian(index: usize) -> GaussianPose2 {
    let root = Matrix3::from_fn(|i, j| 0.1 * noise(index, 4 + 3 * i + j) - 0.05);
    GaussianPose2 { mean: some_pose(index), covariance: root * root.transpose() }
}

/// A patch of a robot; every third with everything that a patch can have.
pub fn some_patch(index: usize, robot: RobotId) -> Patch {
    let beams = 5 + index % 7;
    let readings: Vec<f32> = (0..beams).map(|i| (50.0 * noise(index * 31 + i, 5)) as f32).collect();
    let full = index.is_multiple_of(3);
    Patch {
        id: PatchId(index as u32),
        robot,
        stamp: Stamp(1_000_000_007 * index as i64),
        scan: Arc::new(Scan::classify(LaserModel::half_circle(beams as u32), &readings)),
        sweep: full.then(|| Sweep {
            twist: Twist { forward_m_per_sec: noise(index, 6), yaw_rad_per_sec: -0.0 },
            duration_secs: 0.1,
            reference: 0.5,
        }),
        base_from_laser: Pose2 { x: 0.2, y: -0.0, yaw: 0.0 },
        attitude: full.then(|| Attitude { roll_rad: noise(index, 7), pitch_rad: -0.01 }),
        island_from_patch: some_pose(index),
        elevation: full.then(|| Elevation { height_m: noise(index, 8), variance_m2: 0.1 }),
        left_out: index % 5 == 4,
    }
}

pub fn some_sighting(index: usize, patch: PatchId) -> PatchSighting {
    let kinds = [LandmarkKind::Victim, LandmarkKind::Tag, LandmarkKind::Robot];
    let sighting = Sighting {
        kind: kinds[index % 3],
        id: (!index.is_multiple_of(3)).then(|| Arc::from(format!("tag \"{index}\"\u{e9}"))),
        position: Vector2::new(noise(index, 1), -0.0),
        covariance: Matrix2::new(0.01, 0.001, 0.001, noise(index, 2)),
        yaw: (index % 3 == 2).then_some((noise(index, 3), 0.2)),
    };
    PatchSighting { patch, stamp: Stamp(-5 * index as i64), sighting }
}

pub fn some_way(index: usize, from: PatchId, to: PatchId) -> Way {
    Way {
        from,
        to,
        motion: index.is_multiple_of(2).then(|| some_gaussian(index)),
        climb: index.is_multiple_of(3).then(|| Climb {
            rise_m: noise(index, 1),
            distance_m: noise(index, 2),
            variance_m2: 0.3,
        }),
    }
}

pub fn some_log(robot: RobotId, name: &str) -> RobotLog {
    RobotLog {
        robot,
        name: name.to_owned(),
        file: format!("logs/{name}.clf.gz"),
        content_hash: "crc64:00:7".into(),
        joined_unix_ns: 1_700_000_000_000_000_000,
        reader_report: "{\"scans\":7}".into(),
    }
}

pub fn some_tracked(index: usize, patch: PatchId) -> TrackedScan {
    TrackedScan {
        stamp_text: format!("{}.{:03}0", index, index % 1000),
        stamp: Stamp(index as i64 * 1_000_000_000),
        patch,
        patch_from_base: some_pose(index + 7),
        odom_from_base: (!index.is_multiple_of(4)).then(|| some_pose(index + 9)),
    }
}

/// A scan as it was taken; every other is its patch's own.
pub fn some_taken(index: usize, robot: RobotId) -> TakenScan {
    let patch = some_patch(index + 11, robot);
    TakenScan {
        found: some_pose(index + 8),
        base_from_laser: patch.base_from_laser,
        sweep: patch.sweep,
        attitude: patch.attitude,
        scan: index.is_multiple_of(2).then_some(patch.scan),
    }
}

/// The `number`-th step of a long story: the same for the same map before it.
///
/// Robots join now and then; every step adds a patch with a relation and two scans; some propose,
/// confirm, retract, re-estimate, leave out. The fixtures were written from its first twelve steps:
/// what those do must not change.
pub fn next_step(map: &mut Manifold, scans: &mut [usize; 3], number: usize) -> Step {
    let mut step = Step { time_unix_ns: number as i64, note: "scans".into(), ..Step::default() };
    if number.is_multiple_of(40) && map.robots().len() < 3 {
        let name = ["alice", "bob", "carol"][map.robots().len()];
        let robot = map.add_robot(name);
        step.logs.push(some_log(robot, name));
    }
    let robot = RobotId((number % map.robots().len()) as u16);
    let patch = map.add_patch(some_patch(map.patches().len(), robot));
    let index = &mut scans[usize::from(robot.0)];
    let taken = [some_taken(*index, robot), some_taken(*index + 1, robot)];
    step.observations.extend(ObservationBlock::pack(robot, *index, &taken));
    for _ in 0..2 {
        step.scans.push((robot, *index, some_tracked(*index, patch)));
        *index += 1;
    }
    if patch.0 > 0 {
        let earlier = PatchId((noise(number, 9) * f64::from(patch.0)) as u32);
        if number % 6 == 5 {
            map.propose(earlier, patch, some_gaussian(number), Provenance::Merge);
        } else {
            map.relate(earlier, patch, some_gaussian(number), Provenance::Sequential);
        }
        map.note_way(some_way(number, earlier, patch));
        let relation = RelationId((noise(number, 10) * map.relations().len() as f64) as u32);
        match number % 7 {
            1 => map.confirm(relation),
            2 => map.retract(relation, Retraction::ByUser),
            3 => map.leave_out(vec![earlier], number.is_multiple_of(2)),
            4 => map.elevate(vec![(earlier, Elevation { height_m: 3.0, variance_m2: 0.5 })]),
            5 => map.note_sighting(some_sighting(number, patch)),
            6 => {
                let all = map.patches().iter().map(|p| (p.id, some_pose(number + p.id.index())));
                let moved = all.collect();
                map.refit(moved);
            }
            _ => {}
        }
    }
    step.metadata.push(("state".into(), format!("mapping {number}")));
    step.changes = map.take_journal();
    step
}

/// The first steps of the story, and the site they lead to.
pub fn story(steps: usize) -> (Vec<Step>, Site) {
    let (mut map, mut scans) = (Manifold::new(), [0; 3]);
    let steps: Vec<Step> = (0..steps).map(|n| next_step(&mut map, &mut scans, n)).collect();
    let site = site_of(&steps);
    (steps, site)
}

/// What a site holds after some steps, by the book: the oracle for the file.
pub fn site_of(steps: &[Step]) -> Site {
    let mut site = Site::default();
    for step in steps {
        for change in &step.changes {
            site.manifold.apply(change).unwrap();
        }
        site.manifold.take_journal();
        site.trajectories.resize_with(site.manifold.robots().len(), Vec::new);
        site.logs.extend(step.logs.iter().map(|log| (log.robot, log.clone())));
        for (robot, index, scan) in &step.scans {
            let scans = &mut site.trajectories[usize::from(robot.0)];
            scans.truncate((*index).max(scans.len()));
            match scans.get_mut(*index) {
                Some(known) => *known = scan.clone(),
                None => scans.push(scan.clone()),
            }
        }
        site.observations.extend(step.observations.iter().cloned());
        site.metadata.extend(step.metadata.iter().cloned());
    }
    site
}

/// Equal in everything but the list of steps.
pub fn assert_same(found: &Site, expected: &Site) {
    assert!(same_map(&found.manifold, &expected.manifold), "another map");
    assert_eq!(found.manifold.islands(), expected.manifold.islands());
    assert_eq!(found.logs, expected.logs);
    assert_eq!(format!("{:?}", found.trajectories), format!("{:?}", expected.trajectories));
    assert_eq!(found.observations, expected.observations);
    assert_eq!(found.metadata, expected.metadata);
}
