//! What the tests share: the two-loop building, recorded and mapped.

use geometry::{Pose2, Vector2};
use manifold::Manifold;
use manifoldslam_slam::{Event, Mapper, SlamConfig, Statistics};
use sensing::Observation;
use std::sync::OnceLock;
use synthetic::{Run, two_loop_building};

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

/// Absolute trajectory error: root mean square distance of positions, metres, after the rigid
/// motion that makes it least (Umeyama 1991, in the plane and without scale).
pub fn ate(truth: &[Pose2], estimate: &[Pose2]) -> f64 {
    assert_eq!(truth.len(), estimate.len(), "every scan has a pose");
    let n = truth.len() as f64;
    let mean = |poses: &[Pose2]| poses.iter().map(Pose2::translation).sum::<Vector2<f64>>() / n;
    let (to, from) = (mean(truth), mean(estimate));
    let (mut cos, mut sin) = (0.0, 0.0);
    for (t, e) in truth.iter().zip(estimate) {
        let (a, b) = (e.translation() - from, t.translation() - to);
        cos += a.dot(&b);
        sin += a.perp(&b);
    }
    let turn = Pose2::new(0.0, 0.0, f64::atan2(sin, cos));
    let squares = truth.iter().zip(estimate).map(|(t, e)| {
        (turn.transform(e.translation() - from) - (t.translation() - to)).norm_squared()
    });
    (squares.sum::<f64>() / n).sqrt()
}

pub fn assert_finite(poses: &[Pose2]) {
    assert!(poses.iter().all(geometry::LieGroup::is_finite));
}
