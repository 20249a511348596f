//! One line of a CARMEN log, without any memory of the lines before it.

use crate::DropReason;
use crate::attitude_line::{AttitudeLine, attitude};
use crate::landmark_line::{SightingLine, landmark};
use crate::number::{is_blank, leading_f32, parse_f32, parse_f64, parse_stamp, parse_u64};
use geometry::Pose2;
use sensing::{Attitude, LaserModel, Stamp, Twist};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::RangeInclusive;

type Range = RangeInclusive<usize>;

/// Coordinates beyond this are garbage, metres.
const MAX_COORDINATE_M: f64 = 1e7;

/// Which laser message a scan came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LaserName {
    /// `FLASER`: the front laser, old format.
    Front,
    /// `RLASER`: the rear laser, old format.
    Rear,
    /// `ROBOTLASER0` to `ROBOTLASER9`.
    Robot(u8),
}

/// A laser line's content, not yet classified.
#[derive(Clone, Debug)]
pub(crate) struct LaserLine {
    pub name: LaserName,
    pub stamp: Stamp,
    pub stamp_text: String,
    pub model: LaserModel,
    /// The maximum range the line states, metres.
    pub stated_max_m: Option<f32>,
    pub readings_m: Vec<f32>,
    pub odom_from_laser: Pose2,
    pub odom_from_base: Pose2,
    /// Field of the line, from 0, at which the laser's pose begins; the base's follows it.
    pub pose_field: usize,
    pub twist: Option<Twist>,
    /// How the base leaned, where it was told.
    pub attitude: Option<Attitude>,
    /// Landmarks seen since the scan before, with their lines.
    pub sightings: Vec<(u64, SightingLine)>,
}

/// What a line says.
#[derive(Debug)]
pub(crate) enum Message<'a> {
    /// A comment or an empty line.
    Nothing,
    Laser(Box<LaserLine>),
    Odometry(Twist),
    Attitude(AttitudeLine),
    Landmark(Box<SightingLine>),
    Param {
        name: &'a [u8],
        value: &'a [u8],
    },
    /// A message of no interest here.
    Other(&'a str),
}

/// What is wrong with a line, and with which field of it (from 1).
#[derive(Debug, PartialEq)]
pub(crate) struct Fault {
    pub field: Option<usize>,
    pub reason: DropReason,
}

/// Parses one line without its newline.
///
/// `complete` is false for a last line without newline: it must then hold every field of its
/// message, so that a stamp cut short is never taken for a stamp.
pub(crate) fn parse(line: &[u8], complete: bool) -> Result<Message<'_>, Fault> {
    let mut fields = Fields::new(line);
    let Some(name) = fields.next() else { return Ok(Message::Nothing) };
    if name[0] == b'#' {
        return Ok(Message::Nothing);
    }
    match name {
        b"FLASER" => old_laser(LaserName::Front, fields, complete),
        b"RLASER" => old_laser(LaserName::Rear, fields, complete),
        b"ODOM" => odometry(fields),
        b"ATTITUDE" => Ok(Message::Attitude(attitude(fields, complete)?)),
        b"LANDMARK" => Ok(Message::Landmark(Box::new(landmark(fields, complete)?))),
        b"PARAM" => Ok(match (fields.next(), fields.next()) {
            (Some(name), Some(value)) => Message::Param { name, value },
            _ => Message::Other("PARAM"),
        }),
        _ => match name.strip_prefix(b"ROBOTLASER") {
            Some([digit @ b'0'..=b'9']) => robot_laser(digit - b'0', fields, complete),
            _ => other(name),
        },
    }
}

/// `FLASER n r1..rn laser_x laser_y laser_yaw robot_x robot_y robot_yaw stamp host logger_stamp`.
fn old_laser(name: LaserName, mut fields: Fields, complete: bool) -> Result<Message, Fault> {
    // Pose, pose, stamp; host and logger stamp are sometimes cut away by converters.
    let readings_m = fields.readings(if complete { 7..=9 } else { 9..=9 }, complete)?;
    let tail = fields.clone().total();
    let pose_field = fields.field;
    let odom_from_laser = fields.pose()?;
    let odom_from_base = fields.pose()?;
    let (stamp, stamp_text) = fields.stamp(complete).map_err(|fault| match tail {
        9 => fault,
        // More likely a reading lost than a host.
        _ => fields.miscounted(readings_m.len() as u64, readings_m.len() + tail, complete),
    })?;
    Ok(Message::Laser(Box::new(LaserLine {
        name,
        stamp,
        stamp_text,
        model: guessed_model(readings_m.len() as u32),
        stated_max_m: None,
        readings_m,
        odom_from_laser,
        odom_from_base,
        pose_field,
        twist: None,
        attitude: None,
        sightings: Vec::new(),
    })))
}

/// `ROBOTLASER1 type start_angle fov resolution max_range accuracy remission_mode n r1..rn
/// m remission1..m laser_pose(3) robot_pose(3) tv rv forward_safety side_safety [turn_axis] stamp
/// host logger_stamp`; early versions have no remissions at all, not even their number.
fn robot_laser(digit: u8, mut fields: Fields, complete: bool) -> Result<Message, Fault> {
    fields.skip(1)?;
    let start = fields.number()?;
    let fov = fields.number()?;
    let resolution = fields.number()?;
    let stated_max = fields.number()? as f32;
    fields.skip(2)?;
    let readings_m = fields.readings(13..=usize::MAX, complete)?;
    let turn_axis = fields.skip_remissions(readings_m.len(), complete)?;
    let pose_field = fields.field;
    let odom_from_laser = fields.pose()?;
    let odom_from_base = fields.pose()?;
    let (forward_m_per_sec, yaw_rad_per_sec) = (fields.number()?, fields.number()?);
    fields.skip(if turn_axis { 3 } else { 2 })?;
    let (stamp, stamp_text) = fields.stamp(complete)?;
    let twist = Twist { forward_m_per_sec, yaw_rad_per_sec };
    let sane = forward_m_per_sec.abs() < 100.0 && yaw_rad_per_sec.abs() < 100.0;
    Ok(Message::Laser(Box::new(LaserLine {
        name: LaserName::Robot(digit),
        stamp,
        stamp_text,
        model: stated_model(readings_m.len() as u32, start, fov, resolution),
        stated_max_m: (stated_max.is_finite() && stated_max > 0.0).then_some(stated_max),
        readings_m,
        odom_from_laser,
        odom_from_base,
        pose_field,
        twist: sane.then_some(twist),
        attitude: None,
        sightings: Vec::new(),
    })))
}

/// `ODOM x y yaw tv rv accel stamp host logger_stamp`: only the velocities are of use, since every
/// laser line carries the pose.
fn odometry(mut fields: Fields) -> Result<Message, Fault> {
    fields.pose()?;
    let (forward_m_per_sec, yaw_rad_per_sec) = (fields.number()?, fields.number()?);
    Ok(Message::Odometry(Twist { forward_m_per_sec, yaw_rad_per_sec }))
}

/// Any other message: a name in capitals, as all CARMEN messages have.
fn other(name: &[u8]) -> Result<Message<'_>, Fault> {
    let is_name = name.len() <= 40
        && name[0].is_ascii_uppercase()
        && name.iter().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b"_-".contains(b));
    match std::str::from_utf8(name) {
        Ok(text) if is_name => Ok(Message::Other(text)),
        _ => Err(Fault { field: Some(1), reason: DropReason::NotAMessage }),
    }
}

/// The scanner of an old laser line, which tells nothing but the number of beams.
///
/// CARMEN's convention is a SICK LMS over the half circle in front, or 100 degrees for 401 beams.
/// Counts that belong to one well-known scanner with a wider view are taken for it: Hokuyo URG-04LX
/// (682 and 726 steps of 360/1024 deg), 270 degrees at 0.5 and 0.25 deg (541 and 1081 beams).
fn guessed_model(beams: u32) -> LaserModel {
    let step = match beams {
        101 => 1.0,
        201 | 541 => 0.5,
        400 | 401 | 1081 => 0.25,
        682 | 683 | 726 => 360.0 / 1024.0,
        _ => return LaserModel::half_circle(beams),
    };
    let step = f64::to_radians(step);
    // An even count of these leaves out the last beam, as with the half circle's 180 and 360.
    let span = step * f64::from(if beams == 400 { 400 } else { beams - 1 });
    centred(beams, -0.5 * span, step)
}

/// The scanner a `ROBOTLASER` line describes; where the description is nonsense, the guess by
/// count.
fn stated_model(beams: u32, start: f64, fov: f64, resolution: f64) -> LaserModel {
    let steps = f64::from(beams.saturating_sub(1).max(1));
    let fits = |step: f64| step.abs() > 1e-4 && step.abs() * steps < TAU * 1.01;
    if start.is_nan() || start.abs() > TAU {
        return guessed_model(beams);
    }
    let fov_known = fov > 0.01 && fov < TAU * 1.01;
    // Beams and resolution may leave out an end of the field of view, but not contradict it.
    let agrees = !fov_known || (resolution.abs() * steps - fov).abs() <= 2.5 * resolution.abs();
    if fits(resolution) && agrees {
        return centred(beams, start, resolution);
    }
    if fov_known { centred(beams, start, fov / steps) } else { guessed_model(beams) }
}

/// A scanner by its first bearing and step, with the default limits.
fn centred(beams: u32, angle_min_rad: f64, angle_increment_rad: f64) -> LaserModel {
    LaserModel { angle_min_rad, angle_increment_rad, ..LaserModel::half_circle(beams) }
}

/// The fields of a line, separated by blanks, with their numbers.
#[derive(Clone)]
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
    field: usize,
}

impl<'a> Fields<'a> {
    fn new(line: &'a [u8]) -> Self {
        Fields { rest: line, field: 0 }
    }

    /// The next field; never empty.
    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.rest.iter().position(|&b| !is_blank(b))?;
        let rest = &self.rest[start..];
        let end = rest.iter().position(|&b| is_blank(b)).unwrap_or(rest.len());
        self.field += 1;
        self.rest = &rest[end..];
        Some(&rest[..end])
    }

    /// How many fields are left.
    pub fn total(mut self) -> usize {
        std::iter::from_fn(|| self.next()).count()
    }

    pub fn fault(&self, reason: DropReason) -> Fault {
        Fault { field: Some(self.field), reason }
    }

    pub fn required(&mut self) -> Result<&'a [u8], Fault> {
        self.next().ok_or(Fault { field: Some(self.field + 1), reason: DropReason::MissingField })
    }

    fn skip(&mut self, count: usize) -> Result<(), Fault> {
        (0..count).try_for_each(|_| self.required().map(drop))
    }

    pub fn number(&mut self) -> Result<f64, Fault> {
        let text = self.required()?;
        parse_f64(text).ok_or_else(|| self.fault(DropReason::NotANumber))
    }

    /// The announced number of readings and the readings, followed by a number of fields within
    /// `tail`.
    fn readings(&mut self, tail: Range, complete: bool) -> Result<Vec<f32>, Fault> {
        let text = self.required()?;
        let announced = parse_u64(text).ok_or_else(|| self.fault(DropReason::NotANumber))?;
        if announced == 0 {
            return Err(self.fault(DropReason::NoBeams));
        }
        let before = self.clone();
        let mut readings = Vec::with_capacity(announced.min(self.rest.len() as u64) as usize);
        let result = (0..announced).try_for_each(|_| {
            readings.push(self.reading()?);
            Ok(())
        });
        if result.is_ok() && tail.contains(&self.clone().total()) {
            return Ok(readings);
        }
        // Which of the readings failed matters only when their number is right.
        let fields = before.clone().total();
        let rest = usize::try_from(announced).ok().and_then(|n| fields.checked_sub(n));
        match result {
            Err(fault) if rest.is_some_and(|rest| tail.contains(&rest)) => Err(fault),
            _ => Err(before.miscounted(announced, fields, complete)),
        }
    }

    fn reading(&mut self) -> Result<f32, Fault> {
        if let Some((value, rest)) = leading_f32(self.rest) {
            self.rest = rest;
            self.field += 1;
            return Ok(value);
        }
        let text = self.required()?;
        parse_f32(text).ok_or_else(|| self.fault(DropReason::NotANumber))
    }

    /// Skips the remissions of a `ROBOTLASER` line; true when a turn axis follows the safety
    /// distances.
    ///
    /// The number of remissions is believed only where it explains the rest of the line.
    fn skip_remissions(&mut self, beams: usize, complete: bool) -> Result<bool, Fault> {
        let rest = self.clone().total();
        let remissions = self.clone().next().and_then(parse_u64).unwrap_or(u64::MAX);
        for (fixed, turn_axis) in [(15, true), (14, false)] {
            if remissions.checked_add(fixed) == Some(rest as u64) {
                return self.skip(1 + remissions as usize).map(|()| turn_axis);
            }
        }
        match rest {
            14 => Ok(true),
            13 => Ok(false),
            _ => Err(self.miscounted(beams as u64, beams + rest, complete)),
        }
    }

    /// The fault of a line whose number of fields does not fit the announced number of beams.
    fn miscounted(&self, announced: u64, fields: usize, complete: bool) -> Fault {
        if complete {
            self.fault(DropReason::BeamCount { announced, fields })
        } else {
            Fault { field: None, reason: DropReason::Truncated }
        }
    }

    pub fn pose(&mut self) -> Result<Pose2, Fault> {
        let mut coordinates = [0.0; 3];
        for value in &mut coordinates {
            *value = self.number()?;
            if value.is_nan() || value.abs() > MAX_COORDINATE_M {
                return Err(self.fault(DropReason::NotFinite));
            }
        }
        let [x, y, yaw] = coordinates;
        Ok(Pose2::new(x, y, yaw))
    }

    /// The stamp. Where the line may have been cut off, a host must follow: a word, no number.
    pub fn stamp(&mut self, complete: bool) -> Result<(Stamp, String), Fault> {
        let text = self.required()?;
        let stamp = parse_stamp(text).ok_or_else(|| self.fault(DropReason::NotANumber))?;
        if !complete && parse_f64(self.required()?).is_some() {
            return Err(self.fault(DropReason::Truncated));
        }
        Ok((stamp, String::from_utf8_lossy(text).into_owned()))
    }
}

/// True when a longer name that starts like this could be a message that is not passed over.
pub(crate) fn may_start_laser(name: &str) -> bool {
    ["FLASER", "RLASER", "ROBOTLASER", "LANDMARK", "ATTITUDE"]
        .iter()
        .any(|laser| laser.starts_with(name))
}

/// The yaw of a laser that looks backwards.
pub(crate) const BACKWARDS: f64 = PI;
/// Less than this away from forwards, an old rear laser line has left its half turn out, radians.
pub(crate) const FORWARDS: f64 = FRAC_PI_2;
