use crate::landmark_columns::Columns;
use crate::lines::{LineEnd, LineReader};
use crate::report::MAX_LISTED;
use crate::sightings::carry_over;
use crate::{DropReason, DroppedLine, LogError, LogFile, LogRecord};
use geometry::{LieGroup, Pose2};
use sensing::{Sighting, Stamp};
use std::io::BufRead;
use std::path::{Path, PathBuf};

/// Longest line of a table, bytes.
const LINE_LIMIT: usize = 4096;
/// Most rows that are kept; further ones are dropped.
const MOST_ROWS: usize = 1_000_000;
/// A sighting longer before the next scan belongs to none, seconds.
const LONGEST_WAIT_SECS: f64 = 10.0;

/// Landmarks that were recorded beside a log, in a table of their own.
///
/// Comma-separated, the first line names the columns, in any order; others than these are passed
/// over, and so are lines that begin with `#`:
///
/// | column | meaning |
/// |---|---|
/// | `stamp` | when, seconds by the log's clock |
/// | `kind` | `victim`, `tag` or `robot` |
/// | `id` | which one; empty or `-` where unknown; of a robot its name |
/// | `x_m`, `y_m` | where, in the frame of the base ... |
/// | `range_m`, `bearing_rad` | ... or so |
/// | `cov_xx_m2`, `cov_xy_m2`, `cov_yy_m2` | covariance ... |
/// | `std_m` | ... or standard deviation along any axis ... |
/// | `range_std_m`, `bearing_std_rad` | ... or along and across the sight line |
/// | `yaw_rad`, `yaw_std_rad` | heading of another robot, where it was seen |
///
/// A row goes with the first scan of the log whose stamp is not before its own.
///
/// ```
/// use manifoldslam_logs::LandmarkTable;
/// let text = "stamp,kind,id,range_m,bearing_rad,range_std_m,bearing_std_rad\n\
///             12.5,tag,7,3.0,0.1,0.2,0.02\n";
/// let table = LandmarkTable::read(text.as_bytes(), "log.landmarks.csv".as_ref()).unwrap();
/// assert_eq!(table.len(), 1);
/// ```
#[derive(Debug)]
pub struct LandmarkTable {
    rows: Vec<Row>,
    next: usize,
    last: Option<(Stamp, Option<Pose2>)>,
    report: TableReport,
}

/// What became of the rows of a [`LandmarkTable`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableReport {
    /// The file.
    pub file: PathBuf,
    /// Sightings that went with a scan.
    pub sightings: u64,
    /// The first rows that could not be used, with reasons.
    pub dropped: Vec<DroppedLine>,
    /// All of them.
    pub dropped_count: u64,
}

#[derive(Debug)]
struct Row {
    line: u64,
    stamp: Stamp,
    sighting: Sighting,
}

impl LandmarkTable {
    /// Where the table beside a log is: `LOG.landmarks.csv`.
    pub fn path_beside(log: &Path) -> PathBuf {
        let mut name = log.as_os_str().to_owned();
        name.push(".landmarks.csv");
        PathBuf::from(name)
    }

    /// The table beside a log, `LOG.landmarks.csv`, if there is one.
    ///
    /// # Errors
    /// When there is one and it cannot be opened or has no usable header.
    pub fn beside(log: &Path) -> Result<Option<Self>, LogError> {
        let path = Self::path_beside(log);
        path.is_file().then(|| Self::read(LogFile::open(&path)?.input, &path)).transpose()
    }

    /// Reads a table. Rows that cannot be used are left out and told by [`LandmarkTable::finish`].
    ///
    /// # Errors
    /// [`LogError::Line`] when the header lacks a column; [`LogError::Read`] when reading fails.
    pub fn read(input: impl BufRead, file: &Path) -> Result<Self, LogError> {
        let mut lines = LineReader::new(input, LINE_LIMIT);
        let mut table = LandmarkTable {
            rows: Vec::new(),
            next: 0,
            last: None,
            report: TableReport { file: file.to_owned(), ..TableReport::default() },
        };
        let mut columns: Option<Columns> = None;
        loop {
            let number = lines.number();
            let end = lines.advance().map_err(|source| LogError::read(file, number, source))?;
            let Some(end) = end else { break };
            let number = lines.number();
            if end == LineEnd::TooLong {
                table.drop_row(number, None, DropReason::TooLong { limit: LINE_LIMIT });
            } else if lines.line().trim_ascii().is_empty() || lines.line().starts_with(b"#") {
                continue;
            } else if let Some(columns) = &columns {
                table.take_row(columns, lines.line(), number);
            } else {
                columns = Some(Columns::of(lines.line()).map_err(|(field, reason)| {
                    let line = DroppedLine { line: number, field, reason };
                    LogError::Line { file: file.to_owned(), line }
                })?);
            }
        }
        table.rows.sort_by_key(|row| row.stamp);
        Ok(table)
    }

    /// Rows that can be used.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// True without a usable row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Gives a record the sightings made since the record before, carried over to where its scan
    /// was taken. Records are given in the log's order.
    pub fn give(&mut self, record: &mut LogRecord) {
        let observation = &mut record.observation;
        let (stamp, odom) = (observation.stamp, observation.odom_from_base);
        while let Some(row) = self.rows.get(self.next).filter(|row| row.stamp <= stamp) {
            let secs = stamp.secs_since(row.stamp);
            if secs > LONGEST_WAIT_SECS {
                let line = row.line;
                self.drop_row(line, None, DropReason::NoScan);
            } else {
                let motion =
                    self.last.and_then(|last| motion_since(row.stamp, last, (stamp, odom)));
                let motion = motion.or_else(|| (secs == 0.0).then_some(Pose2::IDENTITY));
                observation.sightings.push(carry_over(&row.sighting, motion, secs));
                self.report.sightings += 1;
            }
            self.next += 1;
        }
        self.last = Some((stamp, odom));
    }

    /// What became of the rows, after the last record.
    pub fn finish(mut self) -> TableReport {
        for row in self.rows.split_off(self.next) {
            self.drop_row(row.line, None, DropReason::NoScan);
        }
        self.report
    }

    fn take_row(&mut self, columns: &Columns, line: &[u8], number: u64) {
        if self.rows.len() >= MOST_ROWS {
            return self.drop_row(number, None, DropReason::TooMany { limit: MOST_ROWS });
        }
        match columns.row(line) {
            Ok((stamp, sighting)) => self.rows.push(Row { line: number, stamp, sighting }),
            Err((field, reason)) => self.drop_row(number, field, reason),
        }
    }

    fn drop_row(&mut self, line: u64, field: Option<usize>, reason: DropReason) {
        self.report.dropped_count += 1;
        if self.report.dropped.len() < MAX_LISTED {
            self.report.dropped.push(DroppedLine { line, field, reason });
        }
    }
}

/// The base at a moment between two scans, seen from the base at the later one, as if it had driven
/// evenly.
fn motion_since(
    moment: Stamp,
    (earlier, odom_from_earlier): (Stamp, Option<Pose2>),
    (later, odom_from_later): (Stamp, Option<Pose2>),
) -> Option<Pose2> {
    let all = later.secs_since(earlier);
    let step = odom_from_later?.between(&odom_from_earlier?).log();
    let share = later.secs_since(moment) / all;
    (all > 0.0 && (0.0..=1.0).contains(&share)).then(|| Pose2::exp(&(step * share)))
}
