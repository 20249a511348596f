use crate::SlamConfig;
use crate::elevation::{ElevationSettings, climbed, raw_slope, slope};
use crate::map::faces;
use crate::unit_bias::UnitBias;
use geometry::{Pose2, Vector2};
use manifold::{Climb, Elevation};
use matching::LinePoint;
use sensing::{Attitude, Levelling, Observation};
use std::borrow::Cow;

/// A base that leans farther than this has fallen over or hangs somewhere, radians: 40 degrees. The
/// steepest stairs are built below it.
const TIPPED_RAD: f64 = 0.7;
/// Scans of a base that leans less than this are taken as they are, radians: within 2 degrees they
/// are less than 6 mm wrong at 10 m.
const LEVEL_RAD: f64 = 0.035;
/// A standing robot's reading counts as if it had driven this far with it, metres: something is
/// known before it moves, and soon outweighed.
const STANDING_WEIGHT_M: f64 = 1e-3;
/// Where odometry does not tell how far, all readings count alike, metres: a slow drive.
const UNMEASURED_WEIGHT_M: f64 = 0.05;
/// Odometry that jumps counts no more than this, metres.
const MOST_WEIGHT_M: f64 = 1.0;
/// A base that leans by so much more or less than where it was before tips over an edge, radians:
/// one degree, twice the noise of two readings.
const TIPPING_RAD: f64 = 0.011;

/// What the inertial unit tells of one robot's way: scans are levelled by it, and heights gained
/// are summed up between patches.
#[derive(Clone, Debug)]
pub(crate) struct Climbing {
    settings: ElevationSettings,
    bias: UnitBias,
    last: Option<Attitude>,
    now: Option<Attitude>,
    /// Odometry as read, and what it is on the plan.
    odometry: Option<(Pose2, Pose2)>,
    since_patch: Option<Climb>,
}

/// Puts the scans of a robot's log on the plan as its mapper did: for drawing scans that were kept.
#[derive(Clone, Debug)]
pub struct Leveller {
    climbing: Climbing,
    config: SlamConfig,
}

impl Leveller {
    /// Before the first scan of a log.
    pub fn new(config: &SlamConfig) -> Self {
        Leveller { climbing: Climbing::new(config.elevation), config: *config }
    }

    /// Takes the next scan of the log; false for one of a base that leans too far to show walls.
    /// Without attitude an observation stays what it is.
    pub fn level(&mut self, observation: &mut Observation) -> bool {
        observation.odom_from_base = self.config.usable_odometry(observation.odom_from_base);
        self.climbing.level_odometry(observation);
        self.climbing.level(observation, &mut Vec::new()) == Stance::Upright
    }
}

/// How the base stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stance {
    Upright,
    /// The scan shows floor, ceiling or sky: it must not be matched.
    Tipped,
}

impl Climbing {
    pub fn new(settings: ElevationSettings) -> Self {
        Climbing {
            settings,
            bias: UnitBias::new(),
            last: None,
            now: None,
            odometry: None,
            since_patch: None,
        }
    }

    /// Takes the next observation's attitude and puts its odometry on the plan: wheels count along
    /// the slope; on the plan the way is shorter. An observation without attitude stays what it is.
    ///
    /// What is found depends on the log alone, so that scans that were kept are levelled again as
    /// they were.
    pub fn level_odometry(&mut self, observation: &mut Observation) {
        self.last = std::mem::replace(&mut self.now, observation.attitude);
        let (Some(reading), odometry) = (observation.attitude, observation.odom_from_base) else {
            self.odometry = None;
            return;
        };
        let before = self.odometry.zip(odometry);
        let driven_m = before.map_or(UNMEASURED_WEIGHT_M, |((last, _), now)| {
            last.distance(&now).clamp(STANDING_WEIGHT_M, MOST_WEIGHT_M)
        });
        self.bias.observe(&reading, driven_m);
        let attitude = reading.without(&self.bias.estimate());
        self.odometry = odometry.map(|now| {
            let plan = before.map_or(now, |((last, plan), _)| {
                let step = last.between(&now);
                let (along, across) = (attitude.pitch_rad.cos(), attitude.roll_rad.cos());
                plan * Pose2::new(step.x * along, step.y * across, step.yaw)
            });
            (now, plan)
        });
        observation.odom_from_base = self.odometry.map(|(_, plan)| plan);
    }

    /// Puts the scan of the observation taken last and its surface on the plan.
    pub fn level(&self, observation: &mut Observation, surface: &mut Vec<LinePoint>) -> Stance {
        let Some(reading) = observation.attitude else { return Stance::Upright };
        let attitude = reading.without(&self.bias.estimate());
        if is_tipped(&attitude) {
            surface.clear();
            return Stance::Tipped;
        }
        if attitude.tilt_rad() > LEVEL_RAD {
            let levelling = Levelling::new(&attitude, self.settings.laser_height_m);
            let mounting = observation.base_from_laser;
            level_points(surface, &levelling);
            observation.scan = levelling.scan(&observation.scan, &mounting);
            observation.base_from_laser = levelling.mounting(&mounting);
        }
        Stance::Upright
    }

    /// Notes the motion found from the scan before to this one.
    pub fn moved(&mut self, motion: &Pose2) {
        let (Some(last), Some(now)) = (self.last, self.now) else {
            self.since_patch = None;
            return;
        };
        let pitch = 0.5 * (last.pitch_rad + now.pitch_rad);
        // Upside down there is no telling: the way counts as level, and doubtful.
        let pitch = pitch.clamp(-TIPPED_RAD, TIPPED_RAD);
        if let Some(climb) = &mut self.since_patch {
            // The motion found is that on the plan.
            climb.rise_m -= motion.x * pitch.tan();
            climb.distance_m += motion.x / pitch.cos();
            let std = self.settings.pitch_noise_rad;
            climb.variance_m2 += std * std * motion.norm() * self.settings.correlation_m;
        }
    }

    /// Slope of the ground under the robot, see `Map::slopes`.
    pub fn slope(&self) -> Vector2<f64> {
        self.now.map_or_else(Vector2::zeros, |reading| slope(&reading, &self.bias.estimate()))
    }

    /// The points of the present scan that a place of slope `before` (in the scan's frame) can be
    /// compared with. While the base tips over the foot or the top of a ramp, the ground ahead
    /// seems to recede or to come nearer: what faces the way it tips says nothing then.
    pub fn comparable<'a>(
        &self,
        surface: &'a [LinePoint],
        before: &Vector2<f64>,
    ) -> Cow<'a, [LinePoint]> {
        let Some(now) = self.now else { return Cow::Borrowed(surface) };
        let tipped = raw_slope(&now, &self.bias.estimate()) - before;
        if tipped.norm() < TIPPING_RAD {
            return Cow::Borrowed(surface);
        }
        let towards = tipped.normalize().cast::<f32>();
        Cow::Owned(surface.iter().filter(|p| !faces(p, &towards)).copied().collect())
    }

    /// The climb since the last patch; from now on it is counted from here.
    pub fn new_patch(&mut self) -> Option<Climb> {
        let start = Climb { rise_m: 0.0, distance_m: 0.0, variance_m2: 0.0 };
        std::mem::replace(&mut self.since_patch, self.now.map(|_| start))
    }

    /// Height of a patch reached by `climb` from one at height `from`, as far as is known by now.
    pub fn elevation(&self, from: Option<Elevation>, climb: Option<Climb>) -> Option<Elevation> {
        let (from, climb) = from.zip(climb)?;
        let (rise_m, variance_m2) = climbed(&climb, self.bias.estimate().pitch_rad);
        Some(Elevation {
            height_m: from.height_m + rise_m,
            variance_m2: from.variance_m2 + variance_m2,
        })
    }
}

/// True for a base that leans too far for its scans to show walls.
pub(crate) fn is_tipped(attitude: &Attitude) -> bool {
    attitude.tilt_rad() > TIPPED_RAD
}

/// Puts points of a leaning laser's plane on the plan; those that may be floor go. Floor shows as a
/// line across the slope: what is as low but runs along it is the wall beside a ramp.
fn level_points(points: &mut Vec<LinePoint>, levelling: &Levelling) {
    let vector = |x: f32, y: f32| Vector2::new(f64::from(x), f64::from(y));
    let uphill = levelling.uphill().cast::<f32>();
    points.retain(|p| levelling.may_be_wall(vector(p.x, p.y)) || !faces(p, &uphill));
    for p in points {
        let at = levelling.project(vector(p.x, p.y));
        let normal = levelling.normal(vector(p.nx, p.ny));
        let stretch = normal.norm();
        (p.x, p.y) = (at.x as f32, at.y as f32);
        (p.nx, p.ny) = ((normal.x / stretch) as f32, (normal.y / stretch) as f32);
        p.variance /= (stretch * stretch) as f32;
    }
}
