use crate::OdometrySettings;
use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use sensing::{Observation, Stamp};

/// What may have happened between two scans.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// The motion expected, with its doubt.
    pub expected: GaussianPose2,
    /// Another one to be tried as well, when odometry is doubtful.
    pub alternative: Option<GaussianPose2>,
    /// Odometry read exactly no motion: wheels that stand and odometry that hangs look the same.
    pub silent: bool,
    /// Nothing was seen for longer than usual.
    pub after_gap: bool,
}

/// Reads odometry and judges what it says: wheels slip, counters hang and start anew elsewhere.
#[derive(Clone, Debug)]
pub(crate) struct Odometer {
    settings: OdometrySettings,
    last_stamp: Option<Stamp>,
    /// Time between scans, seconds: a running mean without the gaps.
    usual_secs: Option<f64>,
    last_reading: Option<Pose2>,
    last_step: Option<Pose2>,
    /// Time between the last two scans, seconds.
    last_secs: f64,
    doubt: Option<Doubt>,
    since_patch: Option<Way>,
}

/// A time of doubtful odometry: it did not change while the robot may have moved, or nothing was
/// seen for a while. It may tell later what it has left out.
#[derive(Clone, Copy, Debug)]
struct Doubt {
    /// The motion from scan to scan before it began.
    before: Pose2,
    /// The motion found since, and what odometry told of it.
    found: Pose2,
    told: Pose2,
    secs: f64,
}

impl Doubt {
    fn after(before: Pose2, secs: f64) -> Self {
        Doubt { before, found: Pose2::IDENTITY, told: Pose2::IDENTITY, secs }
    }

    fn on(&mut self, found: &Pose2, told: &Pose2, secs: f64) {
        self.found = self.found * *found;
        self.told = self.told * *told;
        self.secs += secs;
    }

    /// A reading doubted by half of what the robot did before.
    fn of(&self, mut reading: GaussianPose2) -> GaussianPose2 {
        let (m, turn) = (0.5 * self.before.norm(), 0.5 * self.before.yaw);
        reading.covariance += Matrix3::from_diagonal(&Vector3::new(m * m, m * m, turn * turn));
        reading
    }

    /// What is left of a reading that also tells what was left out before.
    fn caught_up(&self, reading: GaussianPose2) -> GaussianPose2 {
        GaussianPose2 { mean: self.found.inverse() * self.told * reading.mean, ..reading }
    }
}

/// A motion, and how far the robot drove and turned on its way.
#[derive(Clone, Copy, Debug)]
struct Way {
    motion: Pose2,
    distance_m: f64,
    turn_rad: f64,
}

impl Way {
    const START: Way = Way { motion: Pose2::IDENTITY, distance_m: 0.0, turn_rad: 0.0 };

    fn on(self, step: Pose2) -> Way {
        Way {
            motion: self.motion * step,
            distance_m: self.distance_m + step.norm(),
            turn_rad: self.turn_rad + step.yaw.abs(),
        }
    }
}

/// Scans this far apart are nothing unusual, seconds; farther apart than the other, the log was
/// stopped.
const USUAL_GAP_SECS: f64 = 1.0;
const MAX_GAP_SECS: f64 = 60.0;
/// What a robot may have done unseen, per second of a gap: metres, metres, radians.
const BLIND_STD_PER_SEC: [f64; 3] = [0.1, 0.1, 0.3];
/// Share of the newest time between scans in their running mean.
const NEWEST: f64 = 0.1;
/// A time this many times the usual one is longer than stamps put on late explain.
const GAPS: f64 = 4.0;
/// Stamps tell no shorter times, seconds.
const LEAST_SECS: f64 = 0.01;
/// Odometry that moves faster than this, metres and radians a second, ...
const JUMP_M_PER_SEC: f64 = 3.0;
const JUMP_RAD_PER_SEC: f64 = 4.0;
/// ... and by so much more than the robot moved from the scan before, metres and radians beyond
/// twice that motion, may have jumped.
const JUMP_M: f64 = 0.3;
const JUMP_RAD: f64 = 0.3;
/// Odometry that tells less than this of a gap may have been held up, metres and radians.
const LITTLE_M: f64 = 0.1;
const LITTLE_RAD: f64 = 0.1;
/// A robot that moved less than this from the scan before may well stand now, metres and radians.
const STANDING_M: f64 = 0.02;
const STANDING_RAD: f64 = 0.02;

impl Odometer {
    pub fn new(settings: OdometrySettings) -> Self {
        Odometer {
            settings,
            last_stamp: None,
            usual_secs: None,
            last_reading: None,
            last_step: None,
            last_secs: USUAL_GAP_SECS,
            doubt: None,
            since_patch: None,
        }
    }

    /// The motion from the observation before to this one, given the motion found up to that one.
    pub fn read(&mut self, observation: &Observation, last_motion: &Pose2) -> Motion {
        let last_secs = self.last_secs;
        let secs = self.secs_since_last(observation.stamp);
        let last = std::mem::replace(&mut self.last_reading, observation.odom_from_base);
        let step = last.zip(observation.odom_from_base).map(|(last, now)| last.between(&now));
        if let Some((doubt, told)) = self.doubt.as_mut().zip(self.last_step) {
            doubt.on(last_motion, &told, secs);
        }
        self.last_step = step;
        let moving = slowed(last_motion, secs / last_secs.max(LEAST_SECS));
        let blind = if secs < MAX_GAP_SECS { (secs - USUAL_GAP_SECS).max(0.0) } else { 0.0 };
        let (expected, alternative) = match step {
            Some(step) => self.judge(step, &moving, secs),
            None => (widened(self.settings.guess(moving, secs), blind), None),
        };
        let silent = step == Some(Pose2::IDENTITY);
        let motion = Motion { expected, alternative, silent, after_gap: blind > 0.0 };
        if step.is_none() || motion.after_gap {
            self.since_patch = None;
        }
        if motion.after_gap { self.after_gap(motion, moving, secs, blind) } else { motion }
    }

    /// What to expect when odometry reads `step` and the robot has been moving by `moving` in a
    /// time like this.
    fn judge(
        &mut self,
        step: Pose2,
        moving: &Pose2,
        secs: f64,
    ) -> (GaussianPose2, Option<GaussianPose2>) {
        let measured = self.settings.gaussian(step);
        let carried_on = self.settings.guess(*moving, secs);
        if step == Pose2::IDENTITY {
            let doubt = *self.doubt.get_or_insert(Doubt::after(*moving, secs));
            self.believe(step, !is_moving(&doubt.before));
            return (doubt.of(measured), is_moving(moving).then_some(carried_on));
        }
        let doubt = self.doubt.take();
        if !is_jump(&step, moving, secs) {
            self.believe(step, true);
            return (measured, None);
        }
        self.believe(step, false);
        match doubt.filter(|doubt| !is_jump(&step, moving, doubt.secs)) {
            Some(doubt) => (doubt.caught_up(measured), Some(carried_on)),
            None => (carried_on, Some(measured)),
        }
    }

    /// The motion over a gap: odometry may have been held up as well, and is in doubt for a while.
    fn after_gap(&mut self, motion: Motion, moving: Pose2, secs: f64, blind: f64) -> Motion {
        self.doubt = Some(Doubt::after(moving, secs));
        let scans = secs / self.usual_secs.unwrap_or(USUAL_GAP_SECS).max(LEAST_SECS);
        let held_up = self.last_step.is_some_and(|step| may_be_held_up(&step, &moving, scans));
        let other = motion.alternative.unwrap_or(motion.expected);
        let alternative = if held_up { Some(widened(other, blind)) } else { motion.alternative };
        Motion { alternative, ..motion }
    }

    /// Adds a step to the way since the last patch, or gives that way up.
    fn believe(&mut self, step: Pose2, believed: bool) {
        self.since_patch = self.since_patch.filter(|_| believed).map(|way| way.on(step));
    }

    /// Forgets the way since the last patch: odometry was found to be wrong on it.
    pub fn distrust(&mut self) {
        self.since_patch = None;
    }

    /// The way since the last patch as odometry has it, `None` where it is not known; from now on
    /// the way is counted from here.
    pub fn new_patch(&mut self) -> Option<GaussianPose2> {
        let way = self.since_patch.replace(Way::START)?;
        Some(self.settings.gaussian_along(way.motion, way.distance_m, way.turn_rad))
    }

    /// Time since the last scan, seconds: the usual time, unless it is far longer. Stamps are put
    /// on late, and together for several scans; those that jump back say nothing.
    fn secs_since_last(&mut self, stamp: Stamp) -> f64 {
        let Some(last) = self.last_stamp.replace(stamp) else { return self.last_secs };
        let secs = stamp.secs_since(last);
        let usual = self.usual_secs.unwrap_or(secs).max(LEAST_SECS);
        let longest = GAPS * usual;
        self.usual_secs = Some(usual + NEWEST * (secs.clamp(0.0, longest) - usual));
        self.last_secs = if secs > longest { secs } else { usual };
        self.last_secs
    }
}

/// A motion over part of its time; the same motion over all of it or more.
fn slowed(motion: &Pose2, part: f64) -> Pose2 {
    let part = part.min(1.0);
    Pose2::new(motion.x * part, motion.y * part, motion.yaw * part)
}

fn is_moving(motion: &Pose2) -> bool {
    motion.norm() > STANDING_M || motion.yaw.abs() > STANDING_RAD
}

/// True when a robot that moved by `last_motion` hardly moves by `step` within `secs`.
fn is_jump(step: &Pose2, last_motion: &Pose2, secs: f64) -> bool {
    let far = (JUMP_M_PER_SEC * secs).max(2.0 * last_motion.norm() + JUMP_M);
    let turned = (JUMP_RAD_PER_SEC * secs).max(2.0 * last_motion.yaw.abs() + JUMP_RAD);
    step.norm() > far || step.yaw.abs() > turned
}

/// True when odometry tells much less than going on as before for the time of so many scans: it may
/// have been held up like the laser.
fn may_be_held_up(step: &Pose2, last: &Pose2, scans: f64) -> bool {
    step.norm() < (0.5 * scans * last.norm()).max(LITTLE_M)
        && step.yaw.abs() < (0.5 * scans * last.yaw.abs()).max(LITTLE_RAD)
}

/// A motion with the doubt of `blind` seconds in which nothing was seen.
fn widened(motion: GaussianPose2, blind: f64) -> GaussianPose2 {
    let unseen = Vector3::from(BLIND_STD_PER_SEC).map(|std| (std * blind).powi(2));
    GaussianPose2 { covariance: motion.covariance + Matrix3::from_diagonal(&unseen), ..motion }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sensing::{LaserModel, RobotId, Scan};

    const STEP: Pose2 = Pose2 { x: 0.2, y: 0.0, yaw: 0.02 };

    /// An odometer whose motions are found as they really were.
    struct Drive {
        odometer: Odometer,
        secs: f64,
        reading: Pose2,
        last_motion: Pose2,
    }

    impl Drive {
        /// A robot that has been driving by [`STEP`] five times a second.
        fn on() -> Self {
            let odometer = Odometer::new(OdometrySettings::default());
            let mut drive =
                Drive { odometer, secs: 0.0, reading: Pose2::IDENTITY, last_motion: STEP };
            (0..30).for_each(|_| {
                drive.next(0.2, STEP, STEP);
            });
            drive.odometer.new_patch();
            drive
        }

        /// Odometry tells `told` after `secs` in which the robot moved by `moved`.
        fn next(&mut self, secs: f64, told: Pose2, moved: Pose2) -> Motion {
            self.secs += secs;
            self.reading = self.reading * told;
            let observation = Observation {
                robot: RobotId(0),
                stamp: Stamp::from_secs(self.secs),
                odom_from_base: Some(self.reading),
                base_from_laser: Pose2::IDENTITY,
                scan: Scan::classify(LaserModel::half_circle(1), &[1.0]),
                sweep: None,
                attitude: None,
                sightings: Vec::new(),
            };
            let motion = self.odometer.read(&observation, &self.last_motion);
            self.last_motion = moved;
            motion
        }
    }

    fn near(motion: &GaussianPose2, pose: Pose2) -> bool {
        let off = motion.mean.between(&pose);
        off.norm() < 1e-6 && off.yaw.abs() < 1e-6
    }

    #[test]
    fn ordinary_odometry_is_taken_as_it_is() {
        let mut drive = Drive::on();
        for told in [STEP, Pose2::new(0.25, 0.01, -0.1), Pose2::new(0.0, 0.0, 0.3)] {
            let motion = drive.next(0.2, told, told);
            assert!(near(&motion.expected, told) && motion.alternative.is_none());
        }
        let way = drive.odometer.new_patch().expect("all of it is believed");
        assert!(near(&way, STEP * Pose2::new(0.25, 0.01, -0.1) * Pose2::new(0.0, 0.0, 0.3)));
    }

    #[test]
    fn a_jump_is_not_expected_but_tried() {
        let mut drive = Drive::on();
        let jump = Pose2::new(3.0, -2.0, 1.0);
        let motion = drive.next(0.2, jump, STEP);
        assert!(near(&motion.expected, STEP));
        assert!(near(&motion.alternative.expect("odometry is tried"), jump));
        assert!(drive.odometer.new_patch().is_none(), "nobody knows how far that was");
        assert!(near(&drive.next(0.2, STEP, STEP).expected, STEP));
    }

    /// Held up for six scans, odometry tells all of it at once; the robot was found to move on for
    /// the first two of them only.
    #[test]
    fn odometry_that_was_held_up_catches_up() {
        let mut drive = Drive::on();
        let first = drive.next(0.2, Pose2::IDENTITY, STEP);
        assert!(first.silent && near(&first.expected, Pose2::IDENTITY));
        assert!(near(&first.alternative.expect("it may have moved on"), STEP));
        drive.next(0.2, Pose2::IDENTITY, STEP);
        for _ in 0..4 {
            drive.next(0.2, Pose2::IDENTITY, Pose2::IDENTITY);
        }
        let driven = (0..7).fold(Pose2::IDENTITY, |sum, _| sum * STEP);
        let motion = drive.next(0.2, driven, STEP);
        let missing = (0..5).fold(Pose2::IDENTITY, |sum, _| sum * STEP);
        assert!(near(&motion.expected, missing), "{motion:?}");
        assert!(drive.odometer.new_patch().is_none());
    }

    #[test]
    fn a_stop_is_believed_when_the_robot_stood_before() {
        let mut drive = Drive::on();
        drive.last_motion = Pose2::IDENTITY;
        let motion = drive.next(0.2, Pose2::IDENTITY, Pose2::IDENTITY);
        assert!(motion.silent && motion.alternative.is_none());
        assert!(near(&drive.odometer.new_patch().expect("it stood"), Pose2::IDENTITY));
    }

    #[test]
    fn odometry_that_went_on_through_a_gap_is_believed() {
        let driven = Pose2::new(4.0, 0.0, 0.1);
        let motion = Drive::on().next(5.0, driven, driven);
        assert!(motion.after_gap && near(&motion.expected, driven));
        assert!(motion.alternative.is_none());
        let told = Pose2::new(0.05, 0.0, 0.01);
        let motion = Drive::on().next(5.0, told, driven);
        let held_up = motion.alternative.expect("it may have been held up");
        assert!(held_up.covariance[(0, 0)] > 10.0 * motion.expected.covariance[(0, 0)]);
    }

    /// Stamps that are put on late, several at once, or jump back make no jumps and no gaps.
    #[test]
    fn uneven_stamps_change_nothing() {
        let mut drive = Drive::on();
        for secs in [0.001, 0.4, 0.001, 0.0, 0.599, -0.3, 0.7, 0.2] {
            let motion = drive.next(secs, STEP, STEP);
            assert!(near(&motion.expected, STEP) && motion.alternative.is_none(), "{secs}");
            assert!(!motion.after_gap, "{secs}");
        }
    }
}
