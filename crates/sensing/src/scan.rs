use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};

/// What a beam's range means (after ROS REP 117).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum BeamClass {
    /// A surface was seen at the range.
    Hit,
    /// Nothing was seen up to the laser's maximum range.
    NoReturn,
    /// Something is nearer than the laser can measure.
    TooClose,
    /// The reading says nothing (NaN, negative, garbage).
    Invalid,
}

/// A laser scanner's geometry and limits. Beam `i` points at `angle_min_rad + i * increment`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaserModel {
    /// Number of beams.
    pub beams: u32,
    /// Bearing of the first beam in the laser frame, radians.
    pub angle_min_rad: f64,
    /// Angle from one beam to the next, radians; negative for scanners mounted upside down.
    pub angle_increment_rad: f64,
    /// Readings below this are [`BeamClass::TooClose`], metres.
    pub range_min_m: f32,
    /// Readings at or above this are [`BeamClass::NoReturn`], metres.
    pub range_max_m: f32,
}

impl LaserModel {
    /// Smallest usable range by default: SICK LMS scanners report garbage below it.
    pub const DEFAULT_RANGE_MIN_M: f32 = 0.05;
    /// Largest usable range by default; no-return codes of common scanners (50, 80, 81.83) lie
    /// above.
    pub const DEFAULT_RANGE_MAX_M: f32 = 40.0;

    /// A scanner whose beams span the half circle in front, right to left, as CARMEN logs have it.
    ///
    /// An even count (180, 360) means one step short of 180 degrees; an odd one (181, 361)
    /// includes both ends.
    pub fn half_circle(beams: u32) -> Self {
        let steps = if beams.is_multiple_of(2) { beams } else { beams.saturating_sub(1) };
        LaserModel {
            beams,
            angle_min_rad: -FRAC_PI_2,
            angle_increment_rad: PI / f64::from(steps.max(1)),
            range_min_m: Self::DEFAULT_RANGE_MIN_M,
            range_max_m: Self::DEFAULT_RANGE_MAX_M,
        }
    }

    /// Bearing of beam `index` in the laser frame, radians.
    pub fn bearing(&self, index: usize) -> f64 {
        self.angle_min_rad + index as f64 * self.angle_increment_rad
    }

    /// What a raw reading in metres means to this scanner. Infinities are REP 117's: no return, too
    /// close.
    pub fn classify(&self, range_m: f32) -> BeamClass {
        if range_m.is_nan() || (range_m < 0.0 && range_m != f32::NEG_INFINITY) {
            BeamClass::Invalid
        } else if range_m >= self.range_max_m {
            BeamClass::NoReturn
        } else if range_m < self.range_min_m {
            BeamClass::TooClose
        } else {
            BeamClass::Hit
        }
    }
}

/// One sweep of a laser scanner with every beam classified.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scan {
    laser: LaserModel,
    ranges: Box<[f32]>,
    classes: Box<[BeamClass]>,
}

impl Scan {
    /// Classifies raw readings in metres. The scan has as many beams as there are readings.
    pub fn classify(laser: LaserModel, readings_m: &[f32]) -> Self {
        let laser = LaserModel { beams: readings_m.len() as u32, ..laser };
        let classes: Box<[BeamClass]> = readings_m.iter().map(|&r| laser.classify(r)).collect();
        let ranges = readings_m
            .iter()
            .zip(&classes)
            .map(|(&r, &class)| match class {
                BeamClass::Hit => r,
                BeamClass::NoReturn => laser.range_max_m,
                BeamClass::TooClose | BeamClass::Invalid => 0.0,
            })
            .collect();
        Scan { laser, ranges, classes }
    }

    /// A scan of beams that are already classified.
    pub(crate) fn from_parts(
        laser: LaserModel,
        ranges: Box<[f32]>,
        classes: Box<[BeamClass]>,
    ) -> Self {
        Scan { laser, ranges, classes }
    }

    /// The scan with some beams taken out: they say nothing, as if they were invalid.
    pub fn without(&self, beams: impl Fn(usize) -> bool) -> Scan {
        let mut scan = self.clone();
        for beam in (0..self.len()).filter(|&beam| beams(beam)) {
            scan.ranges[beam] = 0.0;
            scan.classes[beam] = BeamClass::Invalid;
        }
        scan
    }

    /// The scanner that took the scan.
    pub fn laser(&self) -> &LaserModel {
        &self.laser
    }

    /// Number of beams, valid or not.
    pub fn len(&self) -> usize {
        self.ranges.len()
    }

    /// True for a scan without beams.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Class of beam `index`.
    pub fn class(&self, index: usize) -> BeamClass {
        self.classes[index]
    }

    /// Range of beam `index`: metres for a hit, the maximum range for no return, 0 otherwise.
    pub fn range(&self, index: usize) -> f32 {
        self.ranges[index]
    }

    /// The measured range of beam `index`, if it hit something.
    pub fn hit(&self, index: usize) -> Option<f32> {
        (self.classes[index] == BeamClass::Hit).then(|| self.ranges[index])
    }

    /// Number of beams that hit something.
    pub fn hit_count(&self) -> usize {
        self.classes.iter().filter(|&&c| c == BeamClass::Hit).count()
    }
}
