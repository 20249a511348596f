use crate::attitude_line::AttitudeLine;
use crate::carmen_line::{self, BACKWARDS, FORWARDS, LaserLine, LaserName, Message};
use crate::landmark_line::SightingLine;
use crate::lines::{LineEnd, LineReader};
use crate::mounting::rigid_mounting;
use crate::number::parse_f64;
use crate::sightings::carry_over;
use crate::{DropReason, LogError, LogFile, LogInput, LogRecord, ReadReport};
use geometry::Pose2;
use sensing::{BeamClass, LaserLimits, LaserModel, NoReturnDetector, Observation, RobotId, Scan};
use sensing::{Sighting, Stamp, Twist};
use std::collections::{BTreeMap, VecDeque};
use std::io::BufRead;
use std::path::{Path, PathBuf};

/// Scans read ahead before the first is handed out, to learn the lasers' mountings and limits.
const LOOK_AHEAD: usize = 256;
/// The no-return code is sought anew after this many scans.
const DETECT_EVERY: u64 = 256;
/// Scans with a smaller share of usable beams are dropped.
const MIN_VALID_SHARE: f64 = 0.1;
/// Landmarks that wait for a scan; further ones are dropped.
const MOST_WAITING: usize = 4096;

/// How a log is read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// The robot the scans are ascribed to.
    pub robot: RobotId,
    /// Which readings count as measured surface.
    pub limits: LaserLimits,
    /// False: scans carry no odometry, as if the robot had none.
    pub use_odometry: bool,
    /// Longer lines are dropped, bytes.
    pub line_limit: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            robot: RobotId(0),
            limits: LaserLimits::default(),
            use_odometry: true,
            line_limit: 64 * 1024,
        }
    }
}

/// Reads the scans of a CARMEN log in the log's order: `FLASER`, `RLASER` and `ROBOTLASER0` to
/// `ROBOTLASER9` lines, with the mountings from the lines themselves or from `PARAM`, and the
/// landmarks of our own `LANDMARK` lines (docs/landmarks.md), each with the scan that
/// follows; and how the robot leaned from `ATTITUDE` lines (docs/levels.md).
///
/// The reader is an iterator that takes any text and never fails: what cannot be used is left out
/// and told by [`CarmenReader::finish`]. Memory is bounded whatever the input. Odometry is the
/// robot pose of the laser line; stamps are kept as text and never used for ordering.
///
/// ```
/// use manifoldslam_logs::{CarmenReader, ReadOptions};
/// let log = "FLASER 3 1.0 2.0 81.83 0.1 0 0 0 0 0 976052857.337530 host 0.0\nFLASER 3 1.0\n";
/// let mut reader = CarmenReader::new(log.as_bytes(), ReadOptions::default());
/// let record = reader.next().unwrap();
/// assert_eq!(record.stamp_text, "976052857.337530");
/// assert_eq!(record.observation.base_from_laser.x, 0.1);
/// assert!(reader.next().is_none());
/// assert_eq!(reader.finish().dropped[0].line, 2);
/// ```
pub struct CarmenReader<R> {
    lines: LineReader<R>,
    file: PathBuf,
    options: ReadOptions,
    lasers: BTreeMap<LaserName, Laser>,
    params: Params,
    pending: VecDeque<(u64, LaserLine)>,
    settled: bool,
    at_end: bool,
    has_odometry: bool,
    odom_twist: Option<Twist>,
    attitude: Option<AttitudeLine>,
    last: Option<Last>,
    /// Landmarks seen since the last scan, with their lines.
    waiting: Vec<(u64, SightingLine)>,
    report: ReadReport,
}

impl CarmenReader<LogInput> {
    /// Opens a log file; see [`LogFile::open`].
    ///
    /// # Errors
    /// When the file cannot be opened.
    pub fn open(path: &Path, options: ReadOptions) -> Result<Self, LogError> {
        Ok(CarmenReader::new(LogFile::open(path)?.input, options).with_name(path))
    }
}

impl<R: BufRead> CarmenReader<R> {
    /// Reads text from `input`.
    pub fn new(input: R, options: ReadOptions) -> Self {
        CarmenReader {
            lines: LineReader::new(input, options.line_limit),
            file: PathBuf::from("log"),
            options,
            lasers: BTreeMap::new(),
            params: Params::default(),
            pending: VecDeque::new(),
            settled: false,
            at_end: false,
            has_odometry: false,
            odom_twist: None,
            attitude: None,
            last: None,
            waiting: Vec::new(),
            report: ReadReport::default(),
        }
    }

    /// The file's name, for messages.
    pub fn with_name(mut self, file: &Path) -> Self {
        self.file = file.to_owned();
        self
    }

    /// What was read, skipped and dropped so far.
    pub fn report(&self) -> &ReadReport {
        &self.report
    }

    /// What was read, skipped and dropped.
    #[must_use = "the report tells what was lost"]
    pub fn finish(self) -> ReadReport {
        self.report
    }

    /// Reads lines until a scan joins the pending ones; false at the end of the input.
    fn read_scan(&mut self) -> bool {
        while !self.at_end {
            match self.lines.advance() {
                Ok(Some(end)) => {
                    self.report.lines = self.lines.number();
                    if self.take_line(end) {
                        return true;
                    }
                }
                Ok(None) => self.at_end = true,
                Err(source) => {
                    self.at_end = true;
                    let failure = LogError::read(&self.file, self.lines.number(), source);
                    self.report.failure = Some(failure);
                }
            }
        }
        false
    }

    /// Takes in the current line; true when it was a scan.
    fn take_line(&mut self, end: LineEnd) -> bool {
        let number = self.lines.number();
        if end == LineEnd::TooLong {
            let reason = DropReason::TooLong { limit: self.options.line_limit };
            self.report.drop_line(number, None, reason);
            return false;
        }
        let complete = end == LineEnd::Newline;
        match carmen_line::parse(self.lines.line(), complete) {
            Ok(Message::Nothing) => {}
            Ok(Message::Odometry(twist)) => self.odom_twist = Some(twist),
            Ok(Message::Attitude(reading)) => self.attitude = Some(reading),
            Ok(Message::Landmark(seen)) if self.waiting.len() < MOST_WAITING => {
                self.waiting.push((number, *seen));
            }
            Ok(Message::Landmark(_)) => {
                let reason = DropReason::TooMany { limit: MOST_WAITING };
                self.report.drop_line(number, None, reason);
            }
            Ok(Message::Param { name, value }) => self.params.take(name, value),
            Ok(Message::Other(name)) => {
                if !complete && carmen_line::may_start_laser(name) {
                    self.report.drop_line(number, None, DropReason::Truncated);
                } else {
                    self.report.skip_message(name);
                }
            }
            Ok(Message::Laser(laser)) => return self.take_scan(number, *laser),
            Err(fault) => {
                let reason = if complete { fault.reason } else { DropReason::Truncated };
                self.report.drop_line(number, fault.field, reason);
            }
        }
        false
    }

    /// Lets a laser line join the pending scans, unless it repeats the line before.
    fn take_scan(&mut self, number: u64, mut line: LaserLine) -> bool {
        if let Some(last) = &self.last {
            if last.name != line.name && last.readings_m == line.readings_m {
                self.report.duplicates += 1;
                return false;
            }
            self.report.stamps_back += u64::from(line.stamp < last.stamp);
        }
        let readings_m = line.readings_m.clone();
        self.last = Some(Last { name: line.name, stamp: line.stamp, readings_m });
        line.twist = line.twist.or(self.odom_twist);
        line.attitude = self.attitude.and_then(|reading| reading.at(line.stamp));
        self.has_odometry |= line.odom_from_base != Pose2::IDENTITY;
        let laser = self.lasers.entry(line.name).or_default();
        if self.options.limits.detect_no_return {
            laser.detector.observe(&line.readings_m);
        }
        laser.scans += 1;
        if self.settled && laser.scans.is_multiple_of(DETECT_EVERY) {
            laser.no_return_m = laser.detector.threshold();
        }
        line.sightings = std::mem::take(&mut self.waiting);
        self.pending.push_back((number, line));
        true
    }

    /// Learns mountings and limits from the scans read ahead.
    fn settle(&mut self) {
        self.settled = true;
        for laser in self.lasers.values_mut() {
            laser.no_return_m = laser.detector.threshold();
        }
    }

    /// The mounting of a laser, learned when its first scan is handed out.
    fn mounting(&mut self, name: LaserName, first: &LaserLine) -> Pose2 {
        if let Some(mounting) = self.lasers.get(&name).and_then(|laser| laser.mounting) {
            return mounting;
        }
        let same = self.pending.iter().map(|(_, line)| line).filter(|line| line.name == name);
        let poses: Vec<_> = std::iter::once(first)
            .chain(same)
            .map(|line| (line.odom_from_laser, line.odom_from_base))
            .collect();
        let mut mounting = rigid_mounting(&poses).unwrap_or_else(|| self.params.mounting(name));
        if name == LaserName::Rear && mounting.yaw.abs() < FORWARDS {
            mounting.yaw = geometry::wrap_angle(mounting.yaw + BACKWARDS);
        }
        self.lasers.entry(name).or_default().mounting = Some(mounting);
        mounting
    }

    /// The landmarks of a scan that was dropped wait for the next.
    fn wait_on(&mut self, sightings: Vec<(u64, SightingLine)>) {
        let next = self.pending.front_mut().map(|(_, line)| &mut line.sightings);
        next.unwrap_or(&mut self.waiting).splice(0..0, sightings);
    }

    /// At the end of the log: no scan comes any more.
    fn give_up_waiting(&mut self) {
        for (number, _) in std::mem::take(&mut self.waiting) {
            self.report.drop_line(number, None, DropReason::NoScan);
        }
    }

    /// Classifies a pending scan; `None` when too little of it is usable.
    fn hand_out(&mut self, number: u64, line: LaserLine) -> Option<LogRecord> {
        let base_from_laser = self.mounting(line.name, &line);
        let detected = self.lasers.get(&line.name).and_then(|laser| laser.no_return_m);
        let limits = &self.options.limits;
        let model = LaserModel {
            range_min_m: limits.range_min_m,
            range_max_m: limits.range_max(line.stated_max_m, detected),
            ..line.model
        };
        let scan = Scan::classify(model, &line.readings_m);
        let beams = scan.len();
        let invalid = (0..beams).filter(|&i| scan.class(i) == BeamClass::Invalid).count();
        if ((beams - invalid) as f64) < MIN_VALID_SHARE * beams as f64 {
            let reason = DropReason::TooFewValidBeams { valid: beams - invalid, beams };
            self.report.drop_line(number, None, reason);
            self.wait_on(line.sightings);
            return None;
        }
        self.report.invalid_beams += invalid as u64;
        self.report.scans += 1;
        let with_odometry = self.options.use_odometry && self.has_odometry;
        let observation = Observation {
            robot: self.options.robot,
            stamp: line.stamp,
            odom_from_base: with_odometry.then_some(line.odom_from_base),
            base_from_laser,
            scan,
            sweep: None,
            attitude: line.attitude,
            sightings: line
                .sightings
                .iter()
                .map(|(_, seen)| carry(seen, &line, with_odometry))
                .collect(),
        };
        self.report.sightings += line.sightings.len() as u64;
        let twist = line.twist.filter(|_| self.options.use_odometry);
        Some(LogRecord { line: number, stamp_text: line.stamp_text, observation, twist })
    }
}

impl<R: BufRead> Iterator for CarmenReader<R> {
    type Item = LogRecord;

    fn next(&mut self) -> Option<LogRecord> {
        loop {
            if !self.settled {
                while self.pending.len() < LOOK_AHEAD && self.read_scan() {}
                self.settle();
            } else if self.pending.is_empty() {
                self.read_scan();
            }
            let Some((number, line)) = self.pending.pop_front() else {
                self.give_up_waiting();
                return None;
            };
            if let Some(record) = self.hand_out(number, line) {
                return Some(record);
            }
        }
    }
}

/// A landmark seen from where a scan was taken.
fn carry(seen: &SightingLine, scan: &LaserLine, with_odometry: bool) -> Sighting {
    let motion = with_odometry.then(|| scan.odom_from_base.between(&seen.odom_from_base));
    carry_over(&seen.sighting, motion, scan.stamp.secs_since(seen.stamp))
}

/// What is learned of one laser.
#[derive(Default)]
struct Laser {
    detector: NoReturnDetector,
    scans: u64,
    no_return_m: Option<f32>,
    mounting: Option<Pose2>,
}

/// The scan read last.
struct Last {
    name: LaserName,
    stamp: Stamp,
    readings_m: Vec<f32>,
}

/// Mountings by `PARAM robot_frontlaser_offset` and its relatives, metres and radians.
#[derive(Default)]
struct Params {
    front: Pose2,
    rear: Pose2,
}

impl Params {
    fn take(&mut self, name: &[u8], value: &[u8]) {
        let Some(value) = parse_f64(value).filter(|v| v.abs() < 100.0) else { return };
        match name {
            b"robot_frontlaser_offset" => self.front.x = value,
            b"robot_frontlaser_side_offset" => self.front.y = value,
            b"robot_frontlaser_angular_offset" => self.front = with_yaw(self.front, value),
            b"robot_rearlaser_offset" => self.rear.x = value,
            b"robot_rearlaser_side_offset" => self.rear.y = value,
            b"robot_rearlaser_angular_offset" => self.rear = with_yaw(self.rear, value),
            _ => {}
        }
    }

    /// CARMEN numbers its lasers 1 front, 2 rear.
    fn mounting(&self, name: LaserName) -> Pose2 {
        match name {
            LaserName::Front | LaserName::Robot(0 | 1) => self.front,
            LaserName::Rear | LaserName::Robot(2) => self.rear,
            LaserName::Robot(_) => Pose2::IDENTITY,
        }
    }
}

fn with_yaw(pose: Pose2, yaw: f64) -> Pose2 {
    Pose2::new(pose.x, pose.y, yaw)
}
