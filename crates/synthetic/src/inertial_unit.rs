use crate::standard_normal;
use rand::Rng;
use sensing::Attitude;

/// What an inertial unit gets wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialUnit {
    /// What it reads on level ground.
    pub bias: Attitude,
    /// Standard deviation of single readings, radians.
    pub noise: f64,
    /// Standard deviation of an error that changes slowly, radians ...
    pub wander: f64,
    /// ... over this time, seconds.
    pub wander_secs: f64,
}

impl Default for InertialUnit {
    /// A unit of a small robot: a third of a degree of noise, a tenth of wander, mounted straight.
    fn default() -> Self {
        InertialUnit { bias: Attitude::default(), noise: 0.006, wander: 0.002, wander_secs: 20.0 }
    }
}

impl InertialUnit {
    /// Readings of true attitudes `interval_secs` apart.
    pub fn read(
        &self,
        truth: &[Attitude],
        interval_secs: f64,
        rng: &mut impl Rng,
    ) -> Vec<Attitude> {
        // A first-order Gauss-Markov process, stationary from the start.
        let kept = (-interval_secs / self.wander_secs).exp();
        let fresh = (1.0 - kept * kept).sqrt();
        let mut slow = [self.wander * standard_normal(rng), self.wander * standard_normal(rng)];
        let mut readings = Vec::with_capacity(truth.len());
        for attitude in truth {
            let [roll_error, pitch_error] = slow.map(|w| w + self.noise * standard_normal(rng));
            readings.push(Attitude {
                roll_rad: attitude.roll_rad + self.bias.roll_rad + roll_error,
                pitch_rad: attitude.pitch_rad + self.bias.pitch_rad + pitch_error,
            });
            slow = slow.map(|w| w * kept + self.wander * fresh * standard_normal(rng));
        }
        readings
    }
}
