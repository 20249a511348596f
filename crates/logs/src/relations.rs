use crate::lines::{LineProblem, read_lines};
use crate::number::parse_f64;
use crate::{DropReason, LogError, LogFile};
use geometry::Pose2;
use std::io::BufRead;
use std::path::Path;

/// A true relative pose between two moments (Kuemmerle et al. 2009, "On measuring the accuracy of
/// SLAM algorithms").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueRelation {
    /// Stamp of the first pose, seconds.
    pub from_secs: f64,
    /// Stamp of the second pose, seconds.
    pub to_secs: f64,
    /// The base at the second stamp, seen from the base at the first.
    pub from_from_to: Pose2,
}

/// Reads lines `t1 t2 x y z roll pitch yaw` with `#` comments; the plane's part is taken.
///
/// # Errors
/// [`LogError::Line`] at the first line that is none; [`LogError::Read`] when reading fails.
pub fn read_relations(input: impl BufRead, file: &Path) -> Result<Vec<TrueRelation>, LogError> {
    read_lines(input, file, parse_line)
}

/// Reads a file of relations; see [`read_relations`].
///
/// # Errors
/// As [`read_relations`], and [`LogError::Open`].
pub fn open_relations(path: &Path) -> Result<Vec<TrueRelation>, LogError> {
    read_relations(LogFile::open(path)?.input, path)
}

fn parse_line(line: &[u8]) -> Result<Option<TrueRelation>, LineProblem> {
    let content = line.split(|&b| b == b'#').next().unwrap_or_default();
    let mut values = [0.0; 8];
    let mut count = 0;
    for text in content.split(u8::is_ascii_whitespace).filter(|text| !text.is_empty()) {
        count += 1;
        let value = values.get_mut(count - 1).ok_or((Some(count), DropReason::ExtraField))?;
        *value = parse_f64(text).ok_or((Some(count), DropReason::NotANumber))?;
        if !value.is_finite() {
            return Err((Some(count), DropReason::NotFinite));
        }
    }
    let [from_secs, to_secs, x, y, _, _, _, yaw] = values;
    match count {
        0 => Ok(None),
        8 => Ok(Some(TrueRelation { from_secs, to_secs, from_from_to: Pose2::new(x, y, yaw) })),
        _ => Err((Some(count + 1), DropReason::MissingField)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relations_are_read_and_faults_named() {
        let read = |text: &str| read_relations(text.as_bytes(), Path::new("true.relations"));
        let good = read("# comment\n1.5 2.5 1 2 9 8 7 0.5 # note\n\n").unwrap();
        let from_from_to = Pose2::new(1.0, 2.0, 0.5);
        assert_eq!(good, [TrueRelation { from_secs: 1.5, to_secs: 2.5, from_from_to }]);
        for (bad, message) in [
            ("1 2 3", "true.relations:1: field 4: too few fields"),
            ("1 2 3 4 5 6 7 8 9", "true.relations:1: field 9: too many fields"),
            ("1 2 x 4 5 6 7 8", "true.relations:1: field 3: not a number"),
            ("1 2 3 4 5 6 7 nan", "true.relations:1: field 8: not finite or absurdly large"),
        ] {
            assert_eq!(read(bad).unwrap_err().to_string(), message);
        }
    }
}
