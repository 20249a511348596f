//! The events are the map: replayed they rebuild it, prepared ahead they stay the same.

use crate::runs::{building, finished, mapped_building};
use geometry::Pose2;
use manifold::{Change, Manifold};
use manifoldslam_slam::{Event, Mapper, Preparation, ScanPose, SlamConfig};

fn rebuild<'a>(events: impl IntoIterator<Item = &'a Event>) -> (Manifold, Vec<ScanPose>) {
    let mut manifold = Manifold::new();
    let mut scans: Vec<ScanPose> = Vec::new();
    for event in events {
        match event {
            Event::Map(change) => manifold.apply(change).expect("events come in order"),
            Event::Localised(index, pose) if *index == scans.len() => scans.push(*pose),
            Event::Localised(index, pose) => scans[*index] = *pose,
        }
    }
    (manifold, scans)
}

fn assert_same(replica: &Manifold, live: &Manifold) {
    assert!(replica.patches() == live.patches(), "patches differ");
    assert_eq!(replica.relations(), live.relations());
    assert_eq!(replica.islands(), live.islands());
}

#[test]
fn events_rebuild_map_and_trajectory() {
    let mapped = mapped_building();
    let (replica, scans) = rebuild(&mapped.events);
    assert_same(&replica, &mapped.manifold);
    let trajectory: Vec<Pose2> = scans.iter().map(|s| s.in_map(&replica)).collect();
    assert_eq!(trajectory, mapped.trajectory);
    let refits = mapped
        .events
        .iter()
        .filter(|e| matches!(e, Event::Map(Change::PosesReestimated(poses)) if !poses.is_empty()));
    assert!(refits.count() > 1, "nothing was re-estimated on the way");
}

/// Whoever listens has the map of that moment, not only the final one.
#[test]
fn events_follow_the_map_step_by_step() {
    let mut mapper = Mapper::new(SlamConfig::default());
    let mut events = Vec::new();
    for (i, observation) in building().observations.iter().take(400).enumerate() {
        events.extend(mapper.step(observation.clone()));
        if i % 80 == 79 {
            let (replica, scans) = rebuild(&events);
            assert_same(&replica, mapper.manifold());
            let trajectory: Vec<Pose2> = scans.iter().map(|s| s.in_map(&replica)).collect();
            assert_eq!(trajectory, mapper.trajectory());
        }
    }
}

#[test]
fn prepared_observations_give_the_same_map() {
    let config = SlamConfig::default();
    let mut preparation = Preparation::new(&config);
    let prepared: Vec<_> =
        building().observations.iter().map(|o| preparation.prepare(o.clone())).collect();
    let mut mapper = Mapper::new(config);
    let mut events = Vec::new();
    for observation in prepared {
        events.extend(mapper.step_prepared(observation));
    }
    events.extend(mapper.finish());
    let ahead = finished(&mapper, events);
    assert!(ahead.events == mapped_building().events, "events differ");
    assert_eq!(ahead.trajectory, mapped_building().trajectory);
}

/// A pass over a map that is still growing leaves it fit to go on.
#[test]
fn mapping_goes_on_after_a_global_pass() {
    let run = building();
    let mut mapper = Mapper::new(SlamConfig::default());
    let mut events = Vec::new();
    for (i, observation) in run.observations.iter().enumerate() {
        events.extend(mapper.step(observation.clone()));
        if i == 300 {
            events.extend(mapper.finish());
        }
    }
    events.extend(mapper.finish());
    let error = crate::runs::ate(&run.truth, &mapper.trajectory());
    println!("ATE {error:.4} m with a global pass on the way");
    assert!(error < 0.05, "{error}");
    assert_same(&rebuild(&events).0, mapper.manifold());
}
