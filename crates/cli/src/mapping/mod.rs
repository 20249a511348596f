//! From logs to maps: each by itself, then together.

mod incoming;
mod joining;
mod keeping;
mod log_facts;
mod mapped_team;
mod one_log;
mod resuming;
mod source;

pub use incoming::read_options;
pub use joining::{map_new, map_onto};
pub use keeping::{MERGES, keep_result};
pub use log_facts::LogFacts;
pub use mapped_team::MappedTeam;
pub use one_log::MappedRobot;
pub use resuming::{bad_stretches, resume, stored_config, stored_scans};
pub use source::{LogSource, canonical, stem};

use anyhow::Result;
use geometry::{Matrix3, Pose2};
use manifold::{Manifold, Provenance};
use optimizer::{Edge, EdgeKind, PoseGraph};
use slam::{Stage, StageObserver};
use std::collections::BTreeMap;
use std::ops::AddAssign;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Wall-clock time spent.
#[derive(Clone, Debug, Default)]
pub struct MappingTimes {
    /// The reading thread at work, beside the mapping.
    pub reading: Duration,
    /// The mapping waiting for the reader.
    pub waiting: Duration,
    /// The stages of the mapping.
    pub stages: BTreeMap<Stage, Duration>,
}

impl AddAssign<&MappingTimes> for MappingTimes {
    fn add_assign(&mut self, other: &MappingTimes) {
        self.reading += other.reading;
        self.waiting += other.waiting;
        for (stage, time) in &other.stages {
            *self.stages.entry(*stage).or_default() += *time;
        }
    }
}

/// Measures the stages of a pipeline, which reads no clock itself.
#[derive(Clone, Debug, Default)]
pub struct StageClock {
    times: Arc<Mutex<BTreeMap<Stage, Duration>>>,
    began: Option<Instant>,
}

impl StageClock {
    /// Times so far.
    pub fn times(&self) -> BTreeMap<Stage, Duration> {
        self.times.lock().map(|times| times.clone()).unwrap_or_default()
    }
}

impl StageObserver for StageClock {
    fn begin(&mut self, _: Stage) {
        self.began = Some(Instant::now());
    }

    fn end(&mut self, stage: Stage) {
        let spent = self.began.map(|began| began.elapsed()).unwrap_or_default();
        if let Ok(mut times) = self.times.lock() {
            *times.entry(stage).or_default() += spent;
        }
    }
}

/// The map as a pose graph: patches and the relations that hold. Each island's first
/// patch is fixed.
pub fn pose_graph(manifold: &Manifold) -> Result<PoseGraph<Pose2, 3>> {
    let mut graph = PoseGraph::new();
    for patch in manifold.patches() {
        graph.add_node(u64::from(patch.id.0), patch.island_from_patch)?;
    }
    for relation in manifold.active_relations() {
        let covariance = relation.from_from_to.covariance;
        let information = covariance.try_inverse().unwrap_or_else(Matrix3::identity);
        let information = 0.5 * (information + information.transpose());
        let kind = match relation.provenance {
            Provenance::Sequential => EdgeKind::Sequential,
            _ => EdgeKind::Closure,
        };
        let (from, to) = (u64::from(relation.from.0), u64::from(relation.to.0));
        graph.add_edge(Edge::new(from, to, relation.from_from_to.mean, information, kind))?;
    }
    for island in manifold.islands() {
        graph.set_fixed(u64::from(island[0].0), true)?;
    }
    Ok(graph)
}

/// Length of a path, metres, without the jitter of a standing robot: steps count from 10 cm on.
pub fn path_length(poses: &[Pose2]) -> f64 {
    let mut length = 0.0;
    let Some(mut last) = poses.first() else { return length };
    for pose in poses {
        let step = last.distance(pose);
        if step >= 0.1 {
            length += step;
            last = pose;
        }
    }
    length
}
