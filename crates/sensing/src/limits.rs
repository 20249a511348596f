use crate::LaserModel;
use serde::{Deserialize, Serialize};

/// Which readings of a laser count as a measured surface, for every log alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LaserLimits {
    /// Readings below this are too close, metres.
    pub range_min_m: f32,
    /// Readings at or above this are no return, whatever the log says, metres.
    pub range_max_m: f32,
    /// Look for the no-return code in the readings themselves (see [`NoReturnDetector`]).
    pub detect_no_return: bool,
}

impl Default for LaserLimits {
    fn default() -> Self {
        LaserLimits {
            range_min_m: LaserModel::DEFAULT_RANGE_MIN_M,
            range_max_m: LaserModel::DEFAULT_RANGE_MAX_M,
            detect_no_return: true,
        }
    }
}

impl LaserLimits {
    /// Everything wrong with the values, one sentence each; empty when they can be used.
    pub fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        if !(self.range_min_m.is_finite() && self.range_min_m >= 0.0) {
            problems.push(format!("range_min_m is {}, must be 0 or more", self.range_min_m));
        }
        if !(self.range_max_m.is_finite() && self.range_max_m > self.range_min_m) {
            let (max, min) = (self.range_max_m, self.range_min_m);
            problems.push(format!("range_max_m is {max}, must be above range_min_m ({min})"));
        }
        problems
    }

    /// The reading from which on a beam has no return: the least of the cap, the maximum range the
    /// log states and the code found in the readings.
    ///
    /// Scanners report "nothing seen" as their maximum range, rounded one way or the other, so a
    /// stated maximum is taken 0.1 % short. Nonsense (zero, negative, NaN) is ignored.
    pub fn range_max(&self, stated_m: Option<f32>, detected_m: Option<f32>) -> f32 {
        let stated = stated_m.map(|r| r * 0.999);
        [stated, detected_m]
            .into_iter()
            .flatten()
            .filter(|&r| r > self.range_min_m.max(0.5))
            .fold(self.range_max_m, f32::min)
    }
}

/// Histogram bins of the detector, a metre: the resolution of the coarsest common logs.
const BINS_PER_M: f32 = 100.0;
/// Readings beyond this are not looked at, metres: above every sensible cap.
const REACH_M: f32 = 100.0;
/// A code must have been read this often.
const MIN_COUNT: u32 = 50;
/// A code is read at least this much more often than any one value in the metre below it.
const DOMINANCE: u32 = 5;
/// Share of the readings at or beyond a code that may lie beyond it (glitches).
const GLITCH_SHARE: f32 = 0.02;
/// A code is read by beams at least this share of the scan apart: a far wall that a standing robot
/// stares at is not.
const MIN_SPREAD: f32 = 1.0 / 6.0;

/// One histogram bin: how often it was read, and by which span of beams.
#[derive(Clone, Copy)]
struct Bin {
    count: u32,
    first_beam: u32,
    last_beam: u32,
}

/// Finds the reading a scanner uses to say "nothing seen" where the log does not tell.
///
/// CARMEN's old laser lines carry no maximum range, and scanners write 8, 16, 32, 50, 80, 81.83 or
/// 81.91 m when no echo comes back. Such a code shows in the histogram of the readings as an
/// isolated peak at its upper end, read by beams all over the scan; ranges to surfaces thin out
/// smoothly. The detector takes scans in the log's order, in constant memory, and depends on
/// nothing else.
#[derive(Clone)]
pub struct NoReturnDetector {
    bins: Box<[Bin]>,
    beams: u32,
}

impl Default for NoReturnDetector {
    fn default() -> Self {
        let empty = Bin { count: 0, first_beam: u32::MAX, last_beam: 0 };
        let bins = vec![empty; (REACH_M * BINS_PER_M) as usize + 1].into_boxed_slice();
        NoReturnDetector { bins, beams: 0 }
    }
}

impl NoReturnDetector {
    /// Takes in one scan's raw readings, metres.
    pub fn observe(&mut self, readings_m: &[f32]) {
        self.beams = self.beams.max(readings_m.len() as u32);
        for (beam, &reading) in readings_m.iter().enumerate() {
            // Float-to-integer conversion saturates: NaN and negatives land in bin 0, never looked
            // at.
            if let Some(bin) = self.bins.get_mut((reading * BINS_PER_M + 0.5) as usize) {
                bin.count = bin.count.saturating_add(1);
                bin.first_beam = bin.first_beam.min(beam as u32);
                bin.last_beam = bin.last_beam.max(beam as u32);
            }
        }
    }

    /// The smallest reading that means "nothing seen", metres, as far as the scans so far tell.
    pub fn threshold(&self) -> Option<f32> {
        let below = BINS_PER_M as usize;
        let mut beyond = 0u64;
        for index in (below..self.bins.len()).rev() {
            let bin = self.bins[index];
            let spread = bin.last_beam.saturating_sub(bin.first_beam) as f32;
            if bin.count >= MIN_COUNT
                && beyond as f32 <= GLITCH_SHARE * (beyond as f32 + bin.count as f32)
                && spread >= MIN_SPREAD * self.beams as f32
                && self.dominates(index, bin.count)
            {
                return Some((index as f32 - 0.5) / BINS_PER_M);
            }
            beyond += u64::from(bin.count);
        }
        None
    }

    /// True when no bin in the metre below `index` holds a fifth of `count`. The bin right below
    /// may hold the same value rounded the other way.
    fn dominates(&self, index: usize, count: u32) -> bool {
        let metre = BINS_PER_M as usize;
        let below = &self.bins[index - metre..index - 1];
        below.iter().all(|bin| bin.count < count / DOMINANCE)
    }
}

impl std::fmt::Debug for NoReturnDetector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NoReturnDetector").field("threshold", &self.threshold()).finish()
    }
}
