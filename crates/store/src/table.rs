//! Tables whose rows carry a checksum, and digests over whole tables.

use crate::cells::Cells;
use crate::checksum::{Crc64, crc64};
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params_from_iter};

/// A table of the state: its columns are followed by `negative_zeros` and `checksum`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Table {
    pub name: &'static str,
    /// How many of the columns, from the first, make the key; rows are read in its order.
    pub key: usize,
    pub columns: &'static [&'static str],
}

/// What a row's own checksum says of it.
pub(crate) enum RowRead {
    Whole(Cells, u64),
    /// The row is there, but not as it was written.
    Damaged,
}

impl Table {
    /// The checksum of a row: over the table's name and the values with their types.
    pub fn checksum(&self, cells: &Cells) -> u64 {
        Crc64::new().update(self.name.as_bytes()).update(&[0]).update(&cells.to_bytes()).value()
    }

    /// Writes a row, or replaces the one of the same key; returns its checksum.
    ///
    /// SQLite turns -0.0 into 0.0 on its way to disk: which columns are meant is kept beside them.
    pub fn put(&self, connection: &Connection, cells: &Cells) -> rusqlite::Result<u64> {
        let checksum = self.checksum(cells);
        let extra = [Value::Integer(negative_zeros(cells)), Value::Integer(checksum as i64)];
        let places = vec!["?"; self.columns.len() + extra.len()].join(",");
        let sql = format!("INSERT OR REPLACE INTO {} VALUES ({places})", self.name);
        connection
            .prepare_cached(&sql)?
            .execute(params_from_iter(cells.0.iter().chain(extra.iter())))?;
        Ok(checksum)
    }

    /// Hands out all rows in the order of their keys.
    pub fn read(
        &self,
        connection: &Connection,
        mut take: impl FnMut(RowRead),
    ) -> rusqlite::Result<()> {
        let order = self.columns[..self.key].join(",");
        let sql = format!("SELECT * FROM {} ORDER BY {order}", self.name);
        let mut statement = connection.prepare(&sql)?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            take(self.read_row(row)?);
        }
        Ok(())
    }

    /// The row of an integer key.
    pub fn read_one(&self, connection: &Connection, key: u32) -> rusqlite::Result<Option<RowRead>> {
        let sql = format!("SELECT * FROM {} WHERE {} = ?", self.name, self.columns[0]);
        let mut statement = connection.prepare_cached(&sql)?;
        let mut rows = statement.query([key])?;
        rows.next()?.map(|row| self.read_row(row)).transpose()
    }

    fn read_row(&self, row: &Row) -> rusqlite::Result<RowRead> {
        let count = self.columns.len();
        let values: Result<Vec<Value>, _> = (0..count).map(|i| row.get(i)).collect();
        let values = match values {
            Ok(values) => values,
            // Text that is not UTF-8 any more.
            Err(rusqlite::Error::FromSqlConversionFailure(..) | rusqlite::Error::Utf8Error(..)) => {
                return Ok(RowRead::Damaged);
            }
            Err(error) => return Err(error),
        };
        let marks = (row.get_ref(count)?.as_i64(), row.get_ref(count + 1)?.as_i64());
        let (Ok(mask), Ok(checksum)) = marks else { return Ok(RowRead::Damaged) };
        let mut cells = Cells(values);
        restore_negative_zeros(&mut cells, mask);
        let whole = self.checksum(&cells) == checksum as u64 && negative_zeros(&cells) == mask;
        Ok(if whole { RowRead::Whole(cells, checksum as u64) } else { RowRead::Damaged })
    }
}

/// A bit for every column that holds -0.0.
fn negative_zeros(cells: &Cells) -> i64 {
    let is_one =
        |value: &Value| matches!(value, Value::Real(x) if *x == 0.0 && x.is_sign_negative());
    cells.0.iter().enumerate().filter(|(_, v)| is_one(v)).fold(0, |mask, (i, _)| mask | 1 << i)
}

fn restore_negative_zeros(cells: &mut Cells, mask: i64) {
    for (i, value) in cells.0.iter_mut().enumerate() {
        if let Value::Real(x) = value
            && *x == 0.0
            && mask >> i & 1 == 1
        {
            *x = -0.0;
        }
    }
}

/// What a whole table should hold: how many rows, and the sum of their checksums. Rows know whether
/// they are damaged; the digest knows whether one is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Digest {
    pub rows: u64,
    pub sum: u64,
}

impl Digest {
    pub fn add(&mut self, checksum: u64) {
        self.rows += 1;
        self.sum = self.sum.wrapping_add(checksum);
    }

    pub fn remove(&mut self, checksum: u64) {
        self.rows = self.rows.wrapping_sub(1);
        self.sum = self.sum.wrapping_sub(checksum);
    }
}

/// The link of the chain that a journal row adds.
pub(crate) fn chain(before: u64, change: u64, step: u64, kind: &str, payload: &[u8]) -> u64 {
    Crc64::new()
        .update(&before.to_le_bytes())
        .update(&change.to_le_bytes())
        .update(&step.to_le_bytes())
        .update(&crc64(kind.as_bytes()).to_le_bytes())
        .update(payload)
        .value()
}
