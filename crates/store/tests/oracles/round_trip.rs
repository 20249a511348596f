//! What is written comes back, bit by bit.

use crate::sites::{
    Scratch, assert_same, site_of, some_gaussian, some_log, some_patch, some_pose, some_sighting,
    some_taken, some_tracked, some_way, story,
};
use manifold::{Change, Manifold, Patch, PatchId, Provenance, RelationId, Retraction};
use manifoldslam_store::{Recorder, SqliteStore, Step, Store, StoreError, read, verify};
use proptest::prelude::*;
use sensing::RobotId;

/// Something done to a map; indices are taken modulo what is there.
#[derive(Clone, Debug)]
enum Deed {
    Join,
    Add,
    Relate(usize, bool),
    Confirm(usize),
    Retract(usize),
    LeaveOut(usize, bool),
    Refit(Vec<(usize, usize)>),
    Way,
    See,
    Track(usize),
    EndStep,
    Reopen,
}

fn deed() -> impl Strategy<Value = Deed> {
    let some = 0..1000usize;
    prop_oneof![
        1 => Just(Deed::Join),
        5 => Just(Deed::Add),
        4 => (some.clone(), any::<bool>()).prop_map(|(a, firm)| Deed::Relate(a, firm)),
        1 => some.clone().prop_map(Deed::Confirm),
        1 => some.clone().prop_map(Deed::Retract),
        1 => (some.clone(), any::<bool>()).prop_map(|(p, out)| Deed::LeaveOut(p, out)),
        2 => prop::collection::vec((some.clone(), some.clone()), 0..6).prop_map(Deed::Refit),
        1 => Just(Deed::Way),
        1 => Just(Deed::See),
        3 => some.prop_map(Deed::Track),
        4 => Just(Deed::EndStep),
        1 => Just(Deed::Reopen),
    ]
}

fn perform(map: &mut Manifold, step: &mut Step, tracked: &mut [Vec<()>; 3], deed: &Deed) {
    let (patches, relations) = (map.patches().len(), map.relations().len());
    let patch = |index: usize| PatchId((index % patches.max(1)) as u32);
    match deed {
        Deed::Join if map.robots().len() < 3 => {
            let robot = map.add_robot(&format!("robot {}", map.robots().len()));
            step.logs.push(some_log(robot, "log"));
        }
        Deed::Add if !map.robots().is_empty() => {
            let robot = RobotId((patches % map.robots().len()) as u16);
            map.add_patch(some_patch(patches, robot));
        }
        Deed::Relate(a, firm) if patches > 1 => {
            let (from, to) = (patch(*a), patch(a + 1));
            if *firm {
                map.relate(from, to, some_gaussian(*a), Provenance::LoopClosure);
            } else {
                map.propose(from, to, some_gaussian(*a), Provenance::Landmark);
            }
        }
        Deed::Confirm(r) if relations > 0 => map.confirm(RelationId((r % relations) as u32)),
        Deed::Retract(r) if relations > 0 => {
            map.retract(RelationId((r % relations) as u32), Retraction::BadData);
        }
        Deed::LeaveOut(p, out) if patches > 0 => map.leave_out(vec![patch(*p)], *out),
        Deed::Refit(poses) if patches > 0 => {
            map.refit(poses.iter().map(|(p, pose)| (patch(*p), some_pose(*pose))).collect());
        }
        Deed::Way if patches > 1 => map.note_way(some_way(patches, patch(0), patch(1))),
        Deed::See if patches > 0 => map.note_sighting(some_sighting(patches, patch(patches - 1))),
        Deed::Track(n) if patches > 0 => {
            let robot = n % map.robots().len();
            // Mostly the next scan, sometimes one that is there already.
            let index = n % (tracked[robot].len() + 1);
            let index = if n % 3 == 0 { index } else { tracked[robot].len() };
            if index == tracked[robot].len() {
                tracked[robot].push(());
            }
            step.scans.push((RobotId(robot as u16), index, some_tracked(*n, patch(*n))));
        }
        _ => {}
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_journal_comes_back(deeds in prop::collection::vec(deed(), 0..80)) {
        let scratch = Scratch::new("journal");
        let file = scratch.at("site.manifold");
        let mut store = SqliteStore::create(&file, "test").unwrap();
        let (mut map, mut tracked) = (Manifold::new(), [vec![], vec![], vec![]]);
        let (mut step, mut written) = (Step::default(), Vec::new());
        for deed in deeds.iter().chain([&Deed::EndStep]) {
            match deed {
                Deed::EndStep => {
                    step.changes = map.take_journal();
                    store.write(&step).unwrap();
                    written.push(std::mem::take(&mut step));
                }
                Deed::Reopen => {
                    store.close().unwrap();
                    store = SqliteStore::open(&file, "test").unwrap();
                }
                deed => perform(&mut map, &mut step, &mut tracked, deed),
            }
        }
        let expected = site_of(&written);
        assert_same(store.site(), &expected);
        // Beside the writer, then after it.
        assert_same(&read(&file).unwrap().site, &expected);
        store.close().unwrap();
        assert_same(&read(&file).unwrap().site, &expected);
        prop_assert_eq!(verify(&file).unwrap(), vec![]);
        prop_assert_eq!(scratch.names(), ["site.manifold"]);
    }
}

#[test]
fn one_file_remains_and_another_day_goes_on() {
    let scratch = Scratch::new("days");
    let file = scratch.at("site.manifold");
    let (steps, expected) = story(120);
    let mut store = SqliteStore::create(&file, "day one").unwrap();
    for step in &steps[..50] {
        store.write(step).unwrap();
    }
    store.close().unwrap();
    assert_eq!(scratch.names(), ["site.manifold"]);
    assert_same(&read(&file).unwrap().site, &site_of(&steps[..50]));
    for part in steps[50..].chunks(20) {
        let mut store = SqliteStore::open(&file, "day two").unwrap();
        part.iter().for_each(|step| store.write(step).unwrap());
        // Dropped, not closed.
    }
    let found = read(&file).unwrap();
    assert_same(&found.site, &expected);
    assert_eq!(found.site.steps.len(), steps.len());
    assert_eq!(found.versions.last().unwrap().1, "day one");
    assert_eq!(verify(&file).unwrap(), []);
    let poses: Vec<_> = found.site.poses(RobotId(1)).collect();
    let first = &expected.trajectories[1][0];
    let island_from_patch = expected.manifold.patch(first.patch).island_from_patch;
    assert_eq!(poses[0], island_from_patch * first.patch_from_base);
    assert_eq!(scratch.names(), ["site.manifold"]);
}

#[test]
fn a_second_writer_is_refused_and_readers_are_not() {
    let scratch = Scratch::new("writers");
    let file = scratch.at("site.manifold");
    let (steps, _) = story(9);
    let mut store = SqliteStore::create(&file, "test").unwrap();
    for (i, step) in steps.iter().enumerate() {
        store.write(step).unwrap();
        assert!(matches!(SqliteStore::open(&file, "test"), Err(StoreError::Locked { .. })));
        assert_same(&read(&file).unwrap().site, &site_of(&steps[..=i]));
    }
    store.close().unwrap();
    SqliteStore::open(&file, "test").unwrap().close().unwrap();
    assert!(matches!(SqliteStore::create(&file, "test"), Err(StoreError::File { .. })));
}

#[test]
fn what_does_not_follow_or_is_no_number_is_refused_and_nothing_of_it_is_written() {
    let scratch = Scratch::new("refused");
    let (steps, expected) = story(20);
    let patch = |x: f64| {
        let patch = some_patch(20, RobotId(0));
        let island_from_patch = geometry::Pose2 { x, ..patch.island_from_patch };
        Change::PatchAdded(Patch { island_from_patch, ..patch })
    };
    let mut far = some_tracked(3, PatchId(0));
    far.patch_from_base.yaw = f64::INFINITY;
    let gap = (RobotId(0), 1000, some_tracked(3, PatchId(0)));
    let endless = (RobotId(0), 0, far);
    for (i, bad) in [
        Step { changes: vec![patch(1.0), patch(1.0)], ..Step::default() },
        Step { changes: vec![patch(f64::NAN)], ..Step::default() },
        Step { changes: vec![patch(1.0)], scans: vec![gap], ..Step::default() },
        Step { changes: vec![patch(1.0)], scans: vec![endless], ..Step::default() },
        Step { logs: vec![some_log(RobotId(7), "nobody")], ..Step::default() },
    ]
    .iter()
    .enumerate()
    {
        let file = scratch.at(&format!("{i}.manifold"));
        let mut store = SqliteStore::create(&file, "test").unwrap();
        steps.iter().for_each(|step| store.write(step).unwrap());
        let error = store.write(bad).unwrap_err();
        match i {
            1 | 3 => assert!(matches!(error, StoreError::NotFinite { .. }), "{error}"),
            _ => assert!(matches!(error, StoreError::OutOfOrder { .. }), "{error}"),
        }
        let good = Step { changes: vec![patch(1.0)], ..Step::default() };
        assert!(matches!(store.write(&good), Err(StoreError::Failed { .. })));
        drop(store);
        assert_same(&read(&file).unwrap().site, &expected);
        let mut store = SqliteStore::open(&file, "test").unwrap();
        store.write(&good).unwrap();
    }
}

#[test]
fn a_recorder_writes_by_count_and_nothing_twice() {
    let scratch = Scratch::new("recorder");
    let file = scratch.at("site.manifold");
    let (steps, expected) = story(40);
    let mut recorder = Recorder::new(SqliteStore::create(&file, "test").unwrap(), 50);
    for step in &steps {
        step.logs.iter().for_each(|log| recorder.set_log(log.clone()));
        step.metadata.iter().for_each(|(key, value)| recorder.set(key, value));
        let taken = step.scans.iter().map(|(robot, i, _)| (*robot, *i, some_taken(*i, *robot)));
        recorder.keep(taken);
        recorder.record(step.changes.clone(), step.scans.clone(), step.time_unix_ns).unwrap();
        let written = recorder.site().manifold.patches().len();
        assert_eq!(read(&file).unwrap().site.manifold.patches().len(), written);
    }
    let written = recorder.site().steps.len();
    assert!((3..8).contains(&written), "{written} steps");
    recorder.commit("last", 77).unwrap();
    recorder.commit("nothing waits", 78).unwrap();
    recorder.close().unwrap();
    let mut found = read(&file).unwrap();
    for robot in [0, 1, 2].map(RobotId) {
        assert_eq!(found.site.taken(robot), expected.taken(robot));
        assert!(found.site.taken(robot).iter().flatten().all(|taken| taken.scan.is_some()));
    }
    assert!(found.site.observations.len() < expected.observations.len());
    found.site.observations.clone_from(&expected.observations);
    assert_same(&found.site, &expected);
    assert_eq!(found.site.steps.len(), written + 1);
    assert_eq!(found.site.steps[written].note, "last");
    assert_eq!(verify(&file).unwrap(), []);
}
