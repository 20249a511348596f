use crate::DropReason;
use crate::landmark_line::{check, check_yaw, id_of, kind_of};
use crate::lines::LineProblem;
use crate::number::{parse_f64, parse_stamp};
use geometry::{Matrix2, Vector2};
use sensing::{Sighting, Stamp};

/// The columns of a table of landmarks.
const NAMES: [&str; 15] = [
    "stamp",
    "kind",
    "id",
    "x_m",
    "y_m",
    "range_m",
    "bearing_rad",
    "cov_xx_m2",
    "cov_xy_m2",
    "cov_yy_m2",
    "std_m",
    "range_std_m",
    "bearing_std_rad",
    "yaw_rad",
    "yaw_std_rad",
];
const STAMP: usize = 0;
const KIND: usize = 1;
const ID: usize = 2;
const POSITION: [usize; 2] = [3, 4];
const RANGE: [usize; 2] = [5, 6];
const COVARIANCE: [usize; 3] = [7, 8, 9];
const STD: [usize; 1] = [10];
const RANGE_STD: [usize; 2] = [11, 12];
const YAW: [usize; 2] = [13, 14];

/// Where in a line the columns are.
#[derive(Clone, Debug)]
pub(crate) struct Columns([Option<usize>; NAMES.len()]);

impl Columns {
    /// The columns by a table's first line.
    pub fn of(line: &[u8]) -> Result<Self, LineProblem> {
        let names: Vec<&[u8]> = cells(line).collect();
        let columns = Columns(NAMES.map(|n| names.iter().position(|name| *name == n.as_bytes())));
        let has = |all: &[usize]| all.iter().all(|&i| columns.0[i].is_some());
        let placed = has(&POSITION) || has(&RANGE);
        let weighed = has(&COVARIANCE) || has(&STD) || has(&RANGE_STD);
        let complete = has(&[STAMP, KIND]) && placed && weighed;
        if complete { Ok(columns) } else { Err((None, DropReason::Header)) }
    }

    /// A row's stamp and what was seen.
    pub fn row(&self, line: &[u8]) -> Result<(Stamp, Sighting), LineProblem> {
        let row = Row { columns: self, cells: cells(line).collect() };
        let stamp = parse_stamp(row.text(STAMP)).ok_or(row.fault(STAMP, DropReason::NotANumber))?;
        let kind = kind_of(row.text(KIND)).ok_or(row.fault(KIND, DropReason::UnknownLandmark))?;
        let id = id_of(kind, row.text(ID)).map_err(|reason| row.fault(ID, reason))?;
        let position = row.position()?;
        let covariance = row.covariance(&position)?;
        check(&position, &covariance).map_err(|reason| (None, reason))?;
        let yaw = row.numbers(YAW)?.map(|[yaw, std]| (yaw, std * std));
        check_yaw(yaw).map_err(|reason| row.fault(YAW[0], reason))?;
        Ok((stamp, Sighting { kind, id, position, covariance, yaw }))
    }
}

fn cells(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(|&b| b == b',').map(<[u8]>::trim_ascii)
}

/// A row's cells.
struct Row<'a> {
    columns: &'a Columns,
    cells: Vec<&'a [u8]>,
}

impl Row<'_> {
    /// A column's cell; empty where the row has none.
    fn text(&self, column: usize) -> &[u8] {
        let cell = self.columns.0[column].and_then(|i| self.cells.get(i));
        cell.copied().unwrap_or_default()
    }

    fn fault(&self, column: usize, reason: DropReason) -> LineProblem {
        (self.columns.0[column].map(|i| i + 1), reason)
    }

    /// Some columns' numbers; `None` if one of them is empty.
    fn numbers<const N: usize>(
        &self,
        columns: [usize; N],
    ) -> Result<Option<[f64; N]>, LineProblem> {
        if columns.iter().any(|&c| self.text(c).is_empty()) {
            return Ok(None);
        }
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            let number = parse_f64(self.text(column));
            *value = number.ok_or(self.fault(column, DropReason::NotANumber))?;
        }
        Ok(Some(values))
    }

    fn position(&self) -> Result<Vector2<f64>, LineProblem> {
        if let Some([x, y]) = self.numbers(POSITION)? {
            return Ok(Vector2::new(x, y));
        }
        let [range, bearing] = self.numbers(RANGE)?.ok_or((None, DropReason::MissingField))?;
        Ok(Vector2::new(bearing.cos(), bearing.sin()) * range)
    }

    fn covariance(&self, position: &Vector2<f64>) -> Result<Matrix2<f64>, LineProblem> {
        if let Some([xx, xy, yy]) = self.numbers(COVARIANCE)? {
            return Ok(Matrix2::new(xx, xy, xy, yy));
        }
        if let Some([std]) = self.numbers(STD)? {
            return Ok(Matrix2::identity() * (std * std));
        }
        let stds = self.numbers(RANGE_STD)?.ok_or((None, DropReason::MissingField))?;
        let (along, across) = (stds[0], stds[1] * position.norm());
        let unit = position.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        let side = Vector2::new(-unit.y, unit.x);
        let squares = (along * along, across * across);
        Ok(unit * unit.transpose() * squares.0 + side * side.transpose() * squares.1)
    }
}
