use sensing::Attitude;

/// An inertial unit reads at most this on level ground, radians: 3 degrees. Ramps that are built
/// for wheels begin above it (1:12 is 4.8 degrees).
const LARGEST_RAD: f64 = 0.0524;
/// Readings this far around the most frequent one are taken for level ground, radians: one degree,
/// the noise of a unit on rough floor.
const AROUND_RAD: f64 = 0.0175;
/// Width of a bin, radians: a tenth of a degree.
const BIN_RAD: f64 = 1.75e-3;
const BINS: usize = 2 * (LARGEST_RAD / BIN_RAD) as usize + 1;

/// What an inertial unit reads on level ground, from most of what it reads: robots drive on the
/// level most of the time (docs/math/elevation.md).
#[derive(Clone, Debug)]
pub(crate) struct UnitBias {
    roll: Mode,
    pitch: Mode,
}

impl UnitBias {
    pub fn new() -> Self {
        UnitBias { roll: Mode::new(), pitch: Mode::new() }
    }

    /// Takes a reading that the robot drove so far with.
    pub fn observe(&mut self, reading: &Attitude, weight_m: f64) {
        self.roll.observe(reading.roll_rad, weight_m);
        self.pitch.observe(reading.pitch_rad, weight_m);
    }

    pub fn estimate(&self) -> Attitude {
        Attitude { roll_rad: self.roll.estimate(), pitch_rad: self.pitch.estimate() }
    }
}

/// The most frequent of angles near zero, by a histogram.
#[derive(Clone, Debug)]
pub(crate) struct Mode {
    /// Weight and weighted sum of each bin.
    bins: Vec<(f64, f64)>,
}

impl Mode {
    pub fn new() -> Self {
        Mode { bins: vec![(0.0, 0.0); BINS] }
    }

    /// Takes an angle; those that cannot be a unit's bias are left out.
    pub fn observe(&mut self, angle_rad: f64, weight: f64) {
        let bin = ((angle_rad + LARGEST_RAD) / BIN_RAD).round();
        if bin >= 0.0 && bin < BINS as f64 && weight > 0.0 {
            let (sum, moment) = &mut self.bins[bin as usize];
            *sum += weight;
            *moment += weight * angle_rad;
        }
    }

    /// The mean of the readings around the heaviest place; zero without any.
    pub fn estimate(&self) -> f64 {
        let half = (AROUND_RAD / BIN_RAD) as usize;
        let window = |centre: usize| {
            let range = centre.saturating_sub(half)..(centre + half + 1).min(BINS);
            let sums = self.bins[range].iter();
            sums.fold((0.0, 0.0), |(w, m), (weight, moment)| (w + weight, m + moment))
        };
        let mut best = (0.0, 0.0);
        for centre in 0..BINS {
            let found = window(centre);
            if found.0 > best.0 * (1.0 + 1e-9) {
                best = found;
            }
        }
        if best.0 > 0.0 { best.1 / best.0 } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A third of the way is ramps, up and down alike or not; the unit reads 1.5 degrees too much,
    /// with a noise of half a degree.
    #[test]
    fn ramps_do_not_draw_the_bias_away() {
        for ramps in [&[-0.12, 0.12][..], &[0.1], &[-0.09]] {
            let mut mode = Mode::new();
            for k in 0..3000 {
                let wave = 0.0087 * (f64::from(k) * 0.7).sin() * std::f64::consts::SQRT_2;
                let slope = if k % 3 == 0 { ramps[k as usize / 3 % ramps.len()] } else { 0.0 };
                mode.observe(0.026 + slope + wave, 0.2);
            }
            assert!((mode.estimate() - 0.026).abs() < 1e-3, "{}", mode.estimate());
        }
    }

    #[test]
    fn nothing_read_is_no_bias() {
        let mut mode = Mode::new();
        mode.observe(0.5, 1.0);
        mode.observe(f64::NAN, 1.0);
        assert_eq!(mode.estimate(), 0.0);
    }
}
