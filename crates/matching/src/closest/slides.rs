use super::step_length;
use geometry::Vector3;

/// Sliding steps are tried once plain ones are shorter than this share of the gate.
const SLOW_SHARE: f64 = 0.1;
/// A sliding step is no longer than this share of the gate: beyond that its pairs are others.
const LONGEST_SHARE: f64 = 0.5;
/// Sliding steps at one gate at most.
const MOST: u32 = 20;
/// So many of them may grow: the gate's pairs have to be found first.
const FREE: u32 = 3;
/// After that a step longer than this many times the one before ends them.
const GROWTH: f64 = 2.0;

/// The steps at one gate of partners that slide. Plain steps drag along walls, where they go a
/// small part of the way only, and stand still long before the few points that see along the wall
/// have pulled the scan to its place; steps that let partners slide go all of it.
#[derive(Default)]
pub(super) struct Slides {
    taken: u32,
    length: f64,
    over: bool,
}

impl Slides {
    /// Whether to look at sliding steps beside this plain one.
    pub fn wanted(&self, plain: &Vector3<f64>, gate_m: f64) -> bool {
        !self.over && step_length(plain) < SLOW_SHARE * gate_m
    }

    /// The sliding step, cut to the gate; none once they grow, or go on for too long.
    pub fn cut(&mut self, slide: Vector3<f64>, gate_m: f64) -> Option<Vector3<f64>> {
        let length = step_length(&slide);
        let grows = self.taken > FREE && length > GROWTH * self.length;
        self.over = self.taken >= MOST || grows;
        if self.over {
            return None;
        }
        (self.taken, self.length) = (self.taken + 1, length);
        Some(slide * (LONGEST_SHARE * gate_m / length.max(1e-300)).min(1.0))
    }
}
