use std::fmt;
use std::path::{Path, PathBuf};

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file cannot be opened.
    #[error("{}: cannot open: {cause}", file.display())]
    Open {
        /// The file.
        file: PathBuf,
        /// What the operating system says.
        cause: std::io::Error,
    },
    /// Reading or decompressing stopped in the middle.
    #[error("{}:{line}: reading stopped here: {cause}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Number of the last line that was read, from 1; 0 when there was none.
        line: u64,
        /// What the operating system or the decompressor says.
        cause: std::io::Error,
    },
    /// A line that a strict reader cannot take.
    #[error("{}:{}: {}", file.display(), line.line, line.problem())]
    Line {
        /// The file.
        file: PathBuf,
        /// Number and reason.
        line: DroppedLine,
    },
}

impl LogError {
    pub(crate) fn read(file: &Path, line: u64, cause: std::io::Error) -> Self {
        LogError::Read { file: file.to_owned(), line, cause }
    }
}

/// A line that was left out, and why.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct DroppedLine {
    /// Number of the line, from 1.
    pub line: u64,
    /// Number of the field in the line, from 1, where one field is to blame.
    pub field: Option<usize>,
    /// What is wrong.
    pub reason: DropReason,
}

impl DroppedLine {
    /// Field and reason, without the line's number.
    pub fn problem(&self) -> String {
        match self.field {
            Some(field) => format!("field {field}: {}", self.reason),
            None => self.reason.to_string(),
        }
    }
}

impl fmt::Display for DroppedLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}", self.line)?;
        match self.field {
            Some(field) => write!(f, ", field {field}: {}", self.reason),
            None => write!(f, ": {}", self.reason),
        }
    }
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DropReason {
    /// The file ends in the middle of the line.
    #[error("the file ends in the middle of the line")]
    Truncated,
    /// The line does not start with the name of a message.
    #[error("not a CARMEN message")]
    NotAMessage,
    /// The line is longer than the limit.
    #[error("longer than {limit} bytes")]
    TooLong {
        /// The limit, bytes.
        limit: usize,
    },
    /// The scan has no beams.
    #[error("a scan without beams")]
    NoBeams,
    /// The announced number of beams and the number of fields do not fit together.
    #[error("{announced} beams announced, but {fields} fields follow")]
    BeamCount {
        /// Beams announced.
        announced: u64,
        /// Fields behind the announcement.
        fields: usize,
    },
    /// A field is missing.
    #[error("too few fields")]
    MissingField,
    /// There are more fields than the format has.
    #[error("too many fields")]
    ExtraField,
    /// A field is not a number.
    #[error("not a number")]
    NotANumber,
    /// A pose or stamp is NaN, infinite or out of every sensible range.
    #[error("not finite or absurdly large")]
    NotFinite,
    /// An angle is NaN or larger than half a turn.
    #[error("not an angle in radians")]
    NotAnAngle,
    /// The line does not start with the name of a graph element this reader knows.
    #[error("not a graph element this reader knows")]
    UnknownElement,
    /// The pose graph does not take the element.
    #[error(transparent)]
    Graph(#[from] optimizer::OptimizerError),
    /// A landmark is of no kind this reader knows.
    #[error("not a kind of landmark: victim, tag or robot")]
    UnknownLandmark,
    /// An id is too long, no text, or missing where there must be one.
    #[error("not an id, or none where a robot needs its name")]
    BadId,
    /// A covariance is not positive definite, or absurdly large.
    #[error("not a covariance: not positive definite, or absurdly large")]
    BadCovariance,
    /// No scan follows to which a landmark could belong.
    #[error("no scan follows soon enough for this landmark")]
    NoScan,
    /// There are more of them than a reader keeps.
    #[error("more than {limit} of these")]
    TooMany {
        /// The limit.
        limit: usize,
    },
    /// A table's first line does not name the columns it needs.
    #[error(
        "the first line must name the columns stamp, kind, x_m and y_m or range_m and bearing_rad, \
         and a covariance"
    )]
    Header,
    /// Hardly a beam of the scan can be used.
    #[error("only {valid} of {beams} beams are valid")]
    TooFewValidBeams {
        /// Valid beams.
        valid: usize,
        /// All beams.
        beams: usize,
    },
}
