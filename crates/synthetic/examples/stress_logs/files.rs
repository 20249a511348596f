use crate::recording::{Entry, Scenario};
use geometry::Pose2;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// Scans at least this many apart are another visit of the place.
const REVISIT_SECS: f64 = 30.0;

/// Writes log, relations and trajectory.
pub fn write(folder: &Path, name: &str, scenario: &Scenario, log: &[Entry]) -> io::Result<()> {
    let mut text = String::from("# message formats defined: PARAM ODOM FLASER ROBOTLASER1\n");
    for entry in log {
        if scenario.robot_laser {
            robot_laser(&mut text, scenario, entry);
        } else {
            front_laser(&mut text, scenario, entry);
        }
    }
    std::fs::write(folder.join(format!("{name}.clf")), text)?;
    std::fs::write(folder.join(format!("{name}.relations")), relations(log))?;
    let mut tum = String::new();
    for entry in log {
        let (p, half) = (entry.truth, 0.5 * entry.truth.yaw);
        let stamp = secs(entry);
        line(&mut tum, format_args!("{stamp} {} {} 0 0 0 {} {}", p.x, p.y, half.sin(), half.cos()));
    }
    std::fs::write(folder.join(format!("{name}.truth.tum")), tum)
}

fn line(text: &mut String, content: std::fmt::Arguments) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{content}");
}

fn secs(entry: &Entry) -> String {
    let micros = entry.stamp_micros;
    format!("{}.{:06}", micros.div_euclid(1_000_000), micros.rem_euclid(1_000_000))
}

fn readings(text: &mut String, entry: &Entry) {
    for range in &entry.readings {
        let _ = write!(text, " {range:.2}");
    }
}

fn poses(text: &mut String, scenario: &Scenario, entry: &Entry) {
    for pose in [entry.odometry * scenario.base_from_laser, entry.odometry] {
        let _ = write!(text, " {:.6} {:.6} {:.6}", pose.x, pose.y, pose.yaw);
    }
}

fn front_laser(text: &mut String, scenario: &Scenario, entry: &Entry) {
    let _ = write!(text, "FLASER {}", entry.readings.len());
    readings(text, entry);
    poses(text, scenario, entry);
    let stamp = secs(entry);
    line(text, format_args!(" {stamp} nohost {stamp}"));
}

fn robot_laser(text: &mut String, scenario: &Scenario, entry: &Entry) {
    let model = sensing::LaserModel::half_circle(scenario.beams);
    let first = model.bearing(0);
    let step = model.bearing(1) - first;
    let _ = write!(
        text,
        "ROBOTLASER1 0 {first:.6} {:.6} {step:.6} {:.2} 0.01 0 {}",
        std::f64::consts::PI,
        scenario.no_return,
        entry.readings.len()
    );
    readings(text, entry);
    let _ = write!(text, " 0");
    poses(text, scenario, entry);
    let stamp = secs(entry);
    line(text, format_args!(" 0.0 0.0 0.0 0.0 0.0 {stamp} nohost {stamp}"));
}

/// `t1 t2 x y z roll pitch yaw` between successive key scans (0.3 to 1 m apart) and between a key
/// scan and the nearest of every other visit of its place.
fn relations(log: &[Entry]) -> String {
    let mut text = String::new();
    let mut relate = |i: usize, j: usize| {
        let pose = log[i].truth.between(&log[j].truth);
        let (from, to) = (secs(&log[i]), secs(&log[j]));
        line(
            &mut text,
            format_args!("{from} {to} {:.6} {:.6} 0 0 0 {:.6}", pose.x, pose.y, pose.yaw),
        );
    };
    let keys = key_scans(log);
    for pair in keys.windows(2) {
        relate(pair[0], pair[1]);
    }
    for (index, &i) in keys.iter().enumerate() {
        let mut nearest: Option<(f64, usize)> = None;
        for &j in keys[..index].iter().rev() {
            let apart = log[i].stamp_micros - log[j].stamp_micros;
            let distance = log[i].truth.distance(&log[j].truth);
            let again = apart as f64 * 1e-6 > REVISIT_SECS && distance < 1.0;
            match nearest {
                Some((best, _)) if again && distance < best => nearest = Some((distance, j)),
                None if again => nearest = Some((distance, j)),
                // One relation for every visit: this one is over.
                Some((_, k)) if distance > 3.0 => {
                    relate(k, i);
                    nearest = None;
                }
                _ => {}
            }
        }
        if let Some((_, k)) = nearest {
            relate(k, i);
        }
    }
    text
}

/// Scans at least half a metre or 0.4 rad apart.
fn key_scans(log: &[Entry]) -> Vec<usize> {
    let mut keys = vec![0];
    let mut last = log.first().map_or(Pose2::IDENTITY, |entry| entry.truth);
    for (i, entry) in log.iter().enumerate() {
        let moved = last.between(&entry.truth);
        if moved.norm() > 0.5 || moved.yaw.abs() > 0.4 {
            keys.push(i);
            last = entry.truth;
        }
    }
    keys
}
