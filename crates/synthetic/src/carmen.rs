use crate::{Run, SyntheticError};
use geometry::Pose2;
use sensing::{BeamClass, LandmarkKind, Observation, Stamp};
use std::io::Write;

/// Writes a run's observations as CARMEN text: one `FLASER` line per scan, with the odometry pose
/// of laser and base. No return reads 81.83 and ranges have two decimals, as scanners of that time
/// had. Before the scan they belong to stand `LANDMARK` lines, and an `ATTITUDE` line where that is
/// known.
///
/// # Errors
/// When the writer fails.
pub fn write_carmen(run: &Run, out: &mut impl Write) -> Result<(), SyntheticError> {
    writeln!(out, "# message formats defined: PARAM SYNC ODOM FLASER RLASER TRUEPOS")?;
    for observation in &run.observations {
        let seconds = Seconds(observation.stamp);
        if let Some(attitude) = observation.attitude {
            let (roll, pitch) = (attitude.roll_rad, attitude.pitch_rad);
            writeln!(out, "ATTITUDE {roll:.6} {pitch:.6} {seconds} nohost {seconds}")?;
        }
        write_sightings(observation, out)?;
        let scan = &observation.scan;
        write!(out, "FLASER {}", scan.len())?;
        for beam in 0..scan.len() {
            match scan.class(beam) {
                BeamClass::Hit => write!(out, " {:.2}", scan.range(beam))?,
                BeamClass::NoReturn => write!(out, " 81.83")?,
                BeamClass::TooClose | BeamClass::Invalid => write!(out, " 0.00")?,
            }
        }
        let base = observation.odom_from_base.unwrap_or(Pose2::IDENTITY);
        for pose in [base * observation.base_from_laser, base] {
            write!(out, " {:.6} {:.6} {:.6}", pose.x, pose.y, pose.yaw)?;
        }
        writeln!(out, " {seconds} nohost {seconds}")?;
    }
    Ok(())
}

/// Writes what was seen from a scan as `LANDMARK kind id|- x y sxx sxy syy [yaw yaw_variance]
/// odom_x odom_y odom_yaw stamp host logger_stamp`.
fn write_sightings(observation: &Observation, out: &mut impl Write) -> Result<(), SyntheticError> {
    let base = observation.odom_from_base.unwrap_or(Pose2::IDENTITY);
    let seconds = Seconds(observation.stamp);
    for sighting in &observation.sightings {
        let kind = match sighting.kind {
            LandmarkKind::Victim => "victim",
            LandmarkKind::Tag => "tag",
            LandmarkKind::Robot => "robot",
        };
        let (id, at) = (sighting.id.as_deref().unwrap_or("-"), sighting.position);
        let c = &sighting.covariance;
        write!(out, "LANDMARK {kind} {id} {:.6} {:.6}", at.x, at.y)?;
        write!(out, " {:.9} {:.9} {:.9}", c[(0, 0)], c[(0, 1)], c[(1, 1)])?;
        if let Some((yaw, variance)) = sighting.yaw {
            write!(out, " {yaw:.6} {variance:.9}")?;
        }
        write!(out, " {:.6} {:.6} {:.6}", base.x, base.y, base.yaw)?;
        writeln!(out, " {seconds} nohost {seconds}")?;
    }
    Ok(())
}

/// Writes true relations as `t1 t2 x y z roll pitch yaw`: the base pose at `t2` seen from `t1`, for
/// every pair of scans `stride` apart and, to check global consistency, for every place that is
/// visited again (within 2 m, at least 100 scans later), once per `stride` scans.
///
/// # Errors
/// When the writer fails.
pub fn write_relations(
    run: &Run,
    stride: usize,
    out: &mut impl Write,
) -> Result<(), SyntheticError> {
    let stride = stride.max(1);
    for i in (0..run.truth.len()).step_by(stride) {
        if i + stride < run.truth.len() {
            write_relation(run, i, i + stride, out)?;
        }
        let revisit = (i + 100..run.truth.len())
            .map(|j| (run.truth[i].distance(&run.truth[j]), j))
            .filter(|&(distance, _)| distance < 2.0)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, j)) = revisit {
            write_relation(run, i, j, out)?;
        }
    }
    Ok(())
}

fn write_relation(
    run: &Run,
    i: usize,
    j: usize,
    out: &mut impl Write,
) -> Result<(), SyntheticError> {
    let [from, to] = [i, j].map(|k| Seconds(run.observations[k].stamp));
    let pose = run.truth[i].between(&run.truth[j]);
    writeln!(out, "{from} {to} {:.6} {:.6} 0 0 0 {:.6}", pose.x, pose.y, pose.yaw)?;
    Ok(())
}

/// Writes the true base poses as a TUM trajectory: `t x y z qx qy qz qw`, world frame.
///
/// # Errors
/// When the writer fails.
pub fn write_truth(run: &Run, out: &mut impl Write) -> Result<(), SyntheticError> {
    for (observation, pose) in run.observations.iter().zip(&run.truth) {
        let (sin, cos) = (0.5 * pose.yaw).sin_cos();
        let seconds = Seconds(observation.stamp);
        writeln!(out, "{seconds} {:.6} {:.6} 0 0 0 {sin:.9} {cos:.9}", pose.x, pose.y)?;
    }
    Ok(())
}

/// A stamp as decimal seconds with six digits, by integer arithmetic.
#[derive(Clone, Copy)]
struct Seconds(Stamp);

impl std::fmt::Display for Seconds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let micros = self.0.0.div_euclid(1000);
        write!(f, "{}.{:06}", micros.div_euclid(1_000_000), micros.rem_euclid(1_000_000))
    }
}
