use crate::SlamConfig;
use matching::{LineExtractor, LinePoint};
use sensing::Observation;

/// The part of a step that needs no map: may run ahead of the mapper, on another thread.
#[derive(Clone, Debug)]
pub struct Preparation {
    lines: LineExtractor,
}

/// An observation with the surfaces its scan shows.
#[derive(Clone, Debug)]
pub struct PreparedObservation {
    pub(crate) observation: Observation,
    pub(crate) surface: Vec<LinePoint>,
}

impl Preparation {
    /// The preparation a mapper of the same configuration expects.
    pub fn new(config: &SlamConfig) -> Self {
        Preparation { lines: LineExtractor::new(config.noise, config.lines) }
    }

    /// Prepares one observation.
    pub fn prepare(&mut self, observation: Observation) -> PreparedObservation {
        let Observation { scan, base_from_laser, sweep, .. } = &observation;
        let surface = self.lines.extract_swept(scan, base_from_laser, sweep.as_ref());
        PreparedObservation { observation, surface }
    }
}
