use crate::{RayCaster, standard_normal};
use geometry::{Pose2, Vector2};
use rand::Rng;
use sensing::{LaserModel, Scan};

/// What a laser scanner gets wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaserNoise {
    /// Standard deviation of a range, metres.
    pub range_std: f64,
    /// A range `r` is read as up to `r * (1 +- relative)`, uniformly, besides: how USARSim's
    /// scanner errs.
    pub relative: f64,
    /// Standard deviation of a beam's bearing, radians.
    pub bearing_std: f64,
    /// Step of the reported ranges, metres; 0 for none.
    pub quantisation: f64,
    /// Probability that a beam returns nothing although a surface is there.
    pub dropout: f64,
    /// Beams longer than this return nothing, metres.
    pub max_range: f64,
}

impl LaserNoise {
    /// A perfect laser that sees 80 m.
    pub const NONE: LaserNoise = LaserNoise {
        range_std: 0.0,
        relative: 0.0,
        bearing_std: 0.0,
        quantisation: 0.0,
        dropout: 0.0,
        max_range: 80.0,
    };

    /// Independent range noise only, as the matcher tests have it.
    pub fn gaussian(range_std: f64) -> Self {
        LaserNoise { range_std, ..Self::NONE }
    }

    /// The range scanner of USARSim, the simulator of the RoboCup Rescue league: every range up to
    /// a thousandth too long or too short, nothing beyond 20 m.
    pub fn usarsim() -> Self {
        LaserNoise { relative: 0.001, max_range: 20.0, ..Self::NONE }
    }

    /// Standard deviation of a reading of this range, quantisation included, metres.
    pub fn range_std_at(&self, range: f64) -> f64 {
        // A uniform error within +-a has the variance a^2 / 3.
        let uniform = (self.relative * range).powi(2) + 0.25 * self.quantisation.powi(2);
        (self.range_std.powi(2) + uniform / 3.0).sqrt()
    }
}

impl Default for LaserNoise {
    /// An indoor time-of-flight scanner of the SICK LMS kind: 15 mm noise, 10 mm steps.
    fn default() -> Self {
        LaserNoise {
            range_std: 0.015,
            relative: 0.0,
            bearing_std: 0.0005,
            quantisation: 0.01,
            dropout: 0.002,
            max_range: 40.0,
        }
    }
}

/// A beam without noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueBeam {
    /// Bearing in the laser frame, radians.
    pub bearing: f64,
    /// True range, metres.
    pub range: f64,
    /// Unit normal of the surface in the laser frame, towards the laser.
    pub normal: Vector2<f64>,
}

/// A laser with its noise and mounting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scanner {
    /// Beams and limits.
    pub laser: LaserModel,
    /// What it gets wrong.
    pub noise: LaserNoise,
    /// Mounting on the robot.
    pub base_from_laser: Pose2,
}

impl Scanner {
    /// A scanner over the front half circle, mounted at the robot's centre.
    pub fn half_circle(beams: u32, noise: LaserNoise) -> Self {
        Scanner { laser: LaserModel::half_circle(beams), noise, base_from_laser: Pose2::IDENTITY }
    }

    /// The scan a robot at `world_from_base` takes.
    pub fn scan(&self, world: &RayCaster, world_from_base: &Pose2, rng: &mut impl Rng) -> Scan {
        let world_from_laser = *world_from_base * self.base_from_laser;
        let readings: Vec<f32> = (0..self.laser.beams as usize)
            .map(|beam| self.reading(world, &world_from_laser, beam, rng) as f32)
            .collect();
        Scan::classify(self.laser, &readings)
    }

    /// What each beam would measure without any noise, `None` where it sees nothing.
    pub fn truth(&self, world: &RayCaster, world_from_base: &Pose2) -> Vec<Option<TrueBeam>> {
        let world_from_laser = *world_from_base * self.base_from_laser;
        let laser_from_world = world_from_laser.inverse();
        (0..self.laser.beams as usize)
            .map(|beam| {
                let bearing = self.laser.bearing(beam);
                let direction = world_from_laser.rotate(unit(bearing));
                let origin = world_from_laser.translation();
                let hit = world.cast(origin, direction, self.max_range())?;
                let normal = laser_from_world.rotate(hit.normal);
                Some(TrueBeam { bearing, range: hit.range, normal })
            })
            .collect()
    }

    /// The range beyond which this scanner reports nothing, metres.
    pub fn max_range(&self) -> f64 {
        self.noise.max_range.min(f64::from(self.laser.range_max_m))
    }

    /// One noisy reading. Draws the same number of random values whatever the beam sees.
    fn reading(&self, world: &RayCaster, laser: &Pose2, beam: usize, rng: &mut impl Rng) -> f64 {
        let noise = &self.noise;
        let bearing = self.laser.bearing(beam) + noise.bearing_std * standard_normal(rng);
        let range_error = noise.range_std * standard_normal(rng);
        // Drawn by scanners alone that have this error: the others' scans stay what they were.
        let scale = match noise.relative {
            0.0 => 1.0,
            share => 1.0 + rng.random_range(-share..share),
        };
        let dropped = rng.random::<f64>() < noise.dropout;
        let hit = world.cast(laser.translation(), laser.rotate(unit(bearing)), self.max_range());
        let nothing = f64::from(self.laser.range_max_m) + 1.0;
        let Some(hit) = hit.filter(|_| !dropped) else {
            return nothing;
        };
        let range = (hit.range * scale + range_error).max(0.0);
        let step = noise.quantisation;
        if step > 0.0 { (range / step).round() * step } else { range }
    }
}

fn unit(bearing: f64) -> Vector2<f64> {
    let (s, c) = bearing.sin_cos();
    Vector2::new(c, s)
}
