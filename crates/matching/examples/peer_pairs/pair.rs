use geometry::{Matrix3, Pose2};
use sensing::{LaserModel, Scan};
use std::error::Error;
use std::fmt::Write;
use std::io;

/// A scan to be matched against a reference of one or more scans at known poses.
///
/// As text it is a block of lines, numbers parted by blanks, lengths in metres, angles in radians:
///
/// ```text
/// pair TASK
/// guess X Y YAW
/// truth X Y YAW
/// bound 9 numbers, row by row (nan where a direction is open)
/// laser BEAMS ANGLE_MIN ANGLE_INCREMENT RANGE_MIN RANGE_MAX
/// reference X Y YAW READING...    (one line for each scan, with its pose in the reference frame)
/// scan READING...
/// end
/// ```
///
/// Points are not written: `reading * (cos, sin)(ANGLE_MIN + i * ANGLE_INCREMENT)` for every
/// reading within the laser's limits, the same for everyone.
pub struct Pair {
    /// Which task it belongs to.
    pub task: String,
    /// Where matching starts, `reference_from_scan`.
    pub guess: Pose2,
    /// What it should find.
    pub truth: Pose2,
    /// Smallest covariance of the pose as a right perturbation.
    pub bound: Option<Matrix3<f64>>,
    /// The reference's scans, each with its pose in the reference frame.
    pub reference: Vec<(Scan, Pose2)>,
    /// The new scan.
    pub scan: Scan,
}

impl Pair {
    /// The block of text.
    pub fn to_text(&self) -> String {
        let laser = self.scan.laser();
        let bound = self.bound.unwrap_or(Matrix3::repeat(f64::NAN));
        let mut text = format!("pair {}\n", self.task);
        let mut line = |name: &str, numbers: &[f64], scan: Option<&Scan>| {
            text.push_str(name);
            numbers.iter().for_each(|n| _ = write!(text, " {n}"));
            let readings = scan.map(readings).into_iter().flatten();
            readings.for_each(|r| _ = write!(text, " {r}"));
            text.push('\n');
        };
        line("guess", &numbers(&self.guess), None);
        line("truth", &numbers(&self.truth), None);
        line("bound", bound.transpose().as_slice(), None);
        let beams = f64::from(laser.beams);
        let limits = [laser.range_min_m, laser.range_max_m].map(f64::from);
        let angles = [laser.angle_min_rad, laser.angle_increment_rad];
        line("laser", &[beams, angles[0], angles[1], limits[0], limits[1]], None);
        for (scan, pose) in &self.reference {
            line("reference", &numbers(pose), Some(scan));
        }
        line("scan", &[], Some(&self.scan));
        text.push_str("end\n");
        text
    }

    /// The next pair of a file; `None` at its end.
    pub fn read(
        lines: &mut impl Iterator<Item = io::Result<String>>,
    ) -> Result<Option<Pair>, Box<dyn Error>> {
        let Some(first) = lines.next().transpose()? else { return Ok(None) };
        let task = first.strip_prefix("pair ").ok_or("no line `pair TASK`")?.to_string();
        let mut header = |name: &str| fields(&lines.next().ok_or("cut short")??, name);
        let guess = pose(&header("guess")?)?;
        let truth = pose(&header("truth")?)?;
        let bound = header("bound")?;
        if bound.len() != 9 {
            return Err("a bound is not nine numbers".into());
        }
        let bound =
            Some(Matrix3::from_row_slice(&bound)).filter(|b| b.iter().all(|v| v.is_finite()));
        let laser = laser(&header("laser")?)?;
        let mut reference = Vec::new();
        loop {
            let line = lines.next().ok_or("cut short")??;
            if line.starts_with("scan") {
                let scan = scan(laser, &fields(&line, "scan")?)?;
                if lines.next().transpose()?.as_deref() != Some("end") {
                    return Err("no line `end`".into());
                }
                return Ok(Some(Pair { task, guess, truth, bound, reference, scan }));
            }
            let numbers = fields(&line, "reference")?;
            let (at, readings) = numbers.split_at_checked(3).ok_or("a reference without a pose")?;
            reference.push((scan(laser, readings)?, pose(at)?));
        }
    }
}

fn readings(scan: &Scan) -> impl Iterator<Item = f32> {
    let nothing = scan.laser().range_max_m + 1.0;
    (0..scan.len()).map(move |beam| scan.hit(beam).unwrap_or(nothing))
}

fn numbers(pose: &Pose2) -> [f64; 3] {
    [pose.x, pose.y, pose.yaw]
}

/// The numbers of a line that begins with `name`.
fn fields(line: &str, name: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let rest = line.strip_prefix(name).ok_or_else(|| format!("no line `{name}`"))?;
    rest.split_whitespace()
        .map(|word| word.parse().map_err(|_| format!("`{word}` in `{name}`").into()))
        .collect()
}

fn pose(numbers: &[f64]) -> Result<Pose2, Box<dyn Error>> {
    match numbers {
        &[x, y, yaw] if x.is_finite() && y.is_finite() && yaw.is_finite() => {
            Ok(Pose2::new(x, y, yaw))
        }
        _ => Err("a pose is not three finite numbers".into()),
    }
}

fn laser(numbers: &[f64]) -> Result<LaserModel, Box<dyn Error>> {
    let &[beams, angle_min_rad, angle_increment_rad, min, max] = numbers else {
        return Err("a laser is not five numbers".into());
    };
    Ok(LaserModel {
        beams: beams as u32,
        angle_min_rad,
        angle_increment_rad,
        range_min_m: min as f32,
        range_max_m: max as f32,
    })
}

fn scan(laser: LaserModel, readings: &[f64]) -> Result<Scan, Box<dyn Error>> {
    if readings.len() != laser.beams as usize {
        return Err(format!("{} readings of {} beams", readings.len(), laser.beams).into());
    }
    let readings: Vec<f32> = readings.iter().map(|&r| r as f32).collect();
    Ok(Scan::classify(laser, &readings))
}
