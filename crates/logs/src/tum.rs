use crate::lines::{LineProblem, read_lines};
use crate::number::{parse_f64, parse_stamp};
use crate::{DropReason, LogError, LogFile};
use geometry::Pose2;
use std::io::{self, BufRead, Write};
use std::path::Path;

/// One pose of a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct TumPose {
    /// The stamp as text, digit by digit.
    pub stamp_text: String,
    /// `map_from_base`.
    pub pose: Pose2,
}

/// Writes a trajectory in TUM format, `stamp x y z qx qy qz qw`, with the stamps verbatim and in
/// the order given. Metres with nanometres, quaternions with twelve digits.
///
/// # Errors
/// Those of `output`.
pub fn write_tum<'a>(
    mut output: impl Write,
    poses: impl IntoIterator<Item = (&'a str, Pose2)>,
) -> io::Result<()> {
    for (stamp, pose) in poses {
        let (qz, qw) = (0.5 * pose.yaw).sin_cos();
        // Adding zero turns -0.0 into 0.0.
        let (x, y) = (pose.x + 0.0, pose.y + 0.0);
        writeln!(output, "{stamp} {x:.9} {y:.9} 0 0 0 {:.12} {:.12}", qz + 0.0, qw + 0.0)?;
    }
    output.flush()
}

/// Reads a planar trajectory: TUM lines, or `stamp x y yaw` lines, with `#` comments.
///
/// Of a pose in space the plane's part is taken (yaw from the quaternion, z left out).
///
/// # Errors
/// [`LogError::Line`] at the first line that is neither; [`LogError::Read`] when reading fails.
pub fn read_tum(input: impl BufRead, file: &Path) -> Result<Vec<TumPose>, LogError> {
    read_lines(input, file, parse_line)
}

/// Reads a trajectory file; see [`read_tum`].
///
/// # Errors
/// As [`read_tum`], and [`LogError::Open`].
pub fn open_tum(path: &Path) -> Result<Vec<TumPose>, LogError> {
    read_tum(LogFile::open(path)?.input, path)
}

/// One line; `None` for a comment.
fn parse_line(line: &[u8]) -> Result<Option<TumPose>, LineProblem> {
    let content = line.split(|&b| b == b'#').next().unwrap_or_default();
    let fields: Vec<&[u8]> = content
        .split(|b| matches!(b, b' ' | b'\t' | b'\r' | b','))
        .filter(|f| !f.is_empty())
        .take(9)
        .collect();
    let Some(&stamp) = fields.first() else { return Ok(None) };
    if parse_stamp(stamp).is_none() {
        return Err((Some(1), DropReason::NotANumber));
    }
    let mut values = [0.0; 7];
    for (i, text) in fields[1..].iter().enumerate().take(7) {
        values[i] = parse_f64(text).ok_or((Some(i + 2), DropReason::NotANumber))?;
        if values[i].is_nan() || values[i].abs() > 1e9 {
            return Err((Some(i + 2), DropReason::NotFinite));
        }
    }
    let [x, y, third, qx, qy, qz, qw] = values;
    let yaw = match fields.len() {
        4 => third,
        8 => quaternion_yaw(qx, qy, qz, qw).ok_or((Some(5), DropReason::NotFinite))?,
        0..8 => return Err((Some(fields.len() + 1), DropReason::MissingField)),
        _ => return Err((Some(9), DropReason::ExtraField)),
    };
    let stamp_text = String::from_utf8_lossy(stamp).into_owned();
    Ok(Some(TumPose { stamp_text, pose: Pose2::new(x, y, yaw) }))
}

/// Yaw of a quaternion of any length but zero.
fn quaternion_yaw(x: f64, y: f64, z: f64, w: f64) -> Option<f64> {
    let squared = x * x + y * y + z * z + w * w;
    (squared > 1e-12)
        .then(|| (2.0 * (w * z + x * y) / squared).atan2(1.0 - 2.0 * (y * y + z * z) / squared))
}
