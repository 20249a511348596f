//! Rows as lists of values, and such lists as bytes.
//!
//! One list serves three ends: the columns of a table, the bytes that its checksum is taken over,
//! and the payload of a journal row.

use rusqlite::types::Value;

/// Values of one row, written in the order of the columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cells(pub Vec<Value>);

impl Cells {
    pub fn int(mut self, value: impl Into<i64>) -> Self {
        self.0.push(Value::Integer(value.into()));
        self
    }

    /// All 64 bits; SQLite knows signed numbers only.
    pub fn bits(self, value: u64) -> Self {
        self.int(value as i64)
    }

    pub fn real(mut self, value: f64) -> Self {
        self.0.push(Value::Real(value));
        self
    }

    pub fn reals(self, values: impl IntoIterator<Item = f64>) -> Self {
        values.into_iter().fold(self, Cells::real)
    }

    /// `N` numbers, or as many empty columns.
    pub fn maybe_reals<const N: usize>(mut self, values: Option<[f64; N]>) -> Self {
        match values {
            Some(values) => self.reals(values),
            None => {
                self.0.extend(std::iter::repeat_n(Value::Null, N));
                self
            }
        }
    }

    pub fn text(mut self, value: &str) -> Self {
        self.0.push(Value::Text(value.to_owned()));
        self
    }

    pub fn maybe_text(mut self, value: Option<&str>) -> Self {
        self.0.push(value.map_or(Value::Null, |text| Value::Text(text.to_owned())));
        self
    }

    pub fn blob(mut self, value: Vec<u8>) -> Self {
        self.0.push(Value::Blob(value));
        self
    }

    /// True when no number is NaN or infinite.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|v| !matches!(v, Value::Real(x) if !x.is_finite()))
    }

    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(16 * self.0.len());
        for value in &self.0 {
            write_value(&mut bytes, value);
        }
        bytes
    }

    /// `None` when the bytes are not exactly a list of values.
    pub fn from_bytes(mut bytes: &[u8]) -> Option<Self> {
        let mut cells = Cells::default();
        while !bytes.is_empty() {
            cells.0.push(read_value(&mut bytes)?);
        }
        Some(cells)
    }

    pub fn reader(self) -> CellReader {
        CellReader(self.0.into_iter())
    }
}

/// Takes values out again, in the same order; `None` when one is not what it should be.
pub(crate) struct CellReader(std::vec::IntoIter<Value>);

impl CellReader {
    pub fn int<T: TryFrom<i64>>(&mut self) -> Option<T> {
        match self.0.next()? {
            Value::Integer(value) => value.try_into().ok(),
            _ => None,
        }
    }

    pub fn bits(&mut self) -> Option<u64> {
        self.int::<i64>().map(|value| value as u64)
    }

    pub fn flag(&mut self) -> Option<bool> {
        match self.int::<u8>()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    pub fn real(&mut self) -> Option<f64> {
        match self.0.next()? {
            Value::Real(value) => Some(value),
            _ => None,
        }
    }

    pub fn reals<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.real()?;
        }
        Some(values)
    }

    /// The outer `None`: neither `N` numbers nor `N` empty columns.
    pub fn maybe_reals<const N: usize>(&mut self) -> Option<Option<[f64; N]>> {
        let mut values = [0.0; N];
        let mut known = 0;
        for value in &mut values {
            match self.0.next()? {
                Value::Real(x) => {
                    *value = x;
                    known += 1;
                }
                Value::Null => {}
                _ => return None,
            }
        }
        match known {
            0 => Some(None),
            n if n == N => Some(Some(values)),
            _ => None,
        }
    }

    pub fn text(&mut self) -> Option<String> {
        self.maybe_text()?
    }

    pub fn maybe_text(&mut self) -> Option<Option<String>> {
        match self.0.next()? {
            Value::Text(text) => Some(Some(text)),
            Value::Null => Some(None),
            _ => None,
        }
    }

    pub fn blob(&mut self) -> Option<Vec<u8>> {
        match self.0.next()? {
            Value::Blob(bytes) => Some(bytes),
            _ => None,
        }
    }

    /// `Some` when nothing is left.
    pub fn end(&mut self) -> Option<()> {
        self.0.next().is_none().then_some(())
    }
}

const NULL: u8 = 0;
const INTEGER: u8 = 1;
const REAL: u8 = 2;
const TEXT: u8 = 3;
const BLOB: u8 = 4;

fn write_value(bytes: &mut Vec<u8>, value: &Value) {
    match value {
        Value::Null => bytes.push(NULL),
        Value::Integer(i) => {
            bytes.push(INTEGER);
            write_signed(bytes, *i);
        }
        Value::Real(x) => {
            bytes.push(REAL);
            bytes.extend(x.to_bits().to_le_bytes());
        }
        Value::Text(text) => {
            bytes.push(TEXT);
            write_varint(bytes, text.len() as u64);
            bytes.extend(text.as_bytes());
        }
        Value::Blob(blob) => {
            bytes.push(BLOB);
            write_varint(bytes, blob.len() as u64);
            bytes.extend(blob);
        }
    }
}

fn read_value(bytes: &mut &[u8]) -> Option<Value> {
    Some(match take(bytes, 1)?[0] {
        NULL => Value::Null,
        INTEGER => Value::Integer(read_signed(bytes)?),
        REAL => Value::Real(f64::from_le_bytes(take(bytes, 8)?.try_into().ok()?)),
        TEXT => {
            let length = read_varint(bytes)?;
            Value::Text(String::from_utf8(take(bytes, length)?.to_vec()).ok()?)
        }
        BLOB => {
            let length = read_varint(bytes)?;
            Value::Blob(take(bytes, length)?.to_vec())
        }
        _ => return None,
    })
}

/// The next `count` bytes.
pub(crate) fn take<'a>(bytes: &mut &'a [u8], count: u64) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(usize::try_from(count).ok()?)?;
    *bytes = rest;
    Some(taken)
}

/// Seven bits a byte, the lowest first; the highest bit says that more follow (LEB128).
pub(crate) fn write_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// The inverse of [`write_varint`]; `None` when the bytes end or tell more than 64 bits.
pub(crate) fn read_varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let byte = take(bytes, 1)?[0];
        let part = u64::from(byte & 0x7f);
        if (part << shift) >> shift != part {
            return None;
        }
        value |= part << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// Small numbers of either sign in few bytes: the sign becomes the lowest bit.
pub(crate) fn write_signed(bytes: &mut Vec<u8>, value: i64) {
    write_varint(bytes, ((value << 1) ^ (value >> 63)) as u64);
}

/// The inverse of [`write_signed`].
pub(crate) fn read_signed(bytes: &mut &[u8]) -> Option<i64> {
    let folded = read_varint(bytes)?;
    Some((folded >> 1) as i64 ^ -((folded & 1) as i64))
}

#[cfg(test)]
mod tests {
    // A test that cannot unwrap has failed.
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    fn value() -> impl Strategy<Value = Value> {
        prop_oneof![
            Just(Value::Null),
            any::<i64>().prop_map(Value::Integer),
            (-1e9..1e9).prop_map(Value::Real),
            Just(Value::Real(-0.0)),
            ".{0,9}".prop_map(Value::Text),
            prop::collection::vec(any::<u8>(), 0..9).prop_map(Value::Blob),
        ]
    }

    proptest! {
        #[test]
        fn lists_come_back(values in prop::collection::vec(value(), 0..9)) {
            let cells = Cells(values);
            let bytes = cells.to_bytes();
            let back = Cells::from_bytes(&bytes).unwrap();
            prop_assert_eq!(back.to_bytes(), bytes.clone());
            prop_assert_eq!(back, cells);
            if let Some((_, shorter)) = bytes.split_last() {
                let cut = Cells::from_bytes(shorter);
                prop_assert!(cut.is_none_or(|c| c.to_bytes() == shorter));
            }
        }

        #[test]
        fn any_bytes_are_taken_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            let _ = Cells::from_bytes(&bytes);
        }

        #[test]
        fn numbers_come_back(number: i64) {
            let mut bytes = Vec::new();
            write_signed(&mut bytes, number);
            prop_assert_eq!(read_signed(&mut &bytes[..]), Some(number));
        }
    }
}
