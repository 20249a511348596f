//! What the tests share: the two-loop building, recorded and mapped.

use geometry::Pose2;
use manifold::Manifold;
use manifoldslam_slam::{Event, Mapper, SlamConfig, Statistics};
use sensing::Observation;
use std::sync::OnceLock;
use synthetic::{Run, trajectory_error, two_loop_building};

/// A finished run, the mapper itself gone.
pub struct Mapped {
    pub trajectory: Vec<Pose2>,
    pub manifold: Manifold,
    pub statistics: Statistics,
    pub events: Vec<Event>,
}

/// The building and the log, 137 m of way on poor wheels.
pub fn building() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| two_loop_building(1))
}

/// The building mapped with the default configuration.
pub fn mapped_building() -> &'static Mapped {
    static MAPPED: OnceLock<Mapped> = OnceLock::new();
    MAPPED.get_or_init(|| map(SlamConfig::default(), &building().observations))
}

pub fn map(config: SlamConfig, observations: &[Observation]) -> Mapped {
    let mut mapper = Mapper::new(config);
    let mut events = Vec::new();
    for observation in observations {
        events.extend(mapper.step(observation.clone()));
    }
    events.extend(mapper.finish());
    finished(&mapper, events)
}

pub fn finished(mapper: &Mapper, events: Vec<Event>) -> Mapped {
    Mapped {
        trajectory: mapper.trajectory(),
        manifold: mapper.manifold().clone(),
        statistics: mapper.statistics(),
        events,
    }
}

/// Absolute trajectory error, metres; every scan has a pose.
pub fn ate(truth: &[Pose2], estimate: &[Pose2]) -> f64 {
    assert_eq!(truth.len(), estimate.len(), "every scan has a pose");
    trajectory_error(truth, estimate)
}

pub fn assert_finite(poses: &[Pose2]) {
    assert!(poses.iter().all(geometry::LieGroup::is_finite));
}
