use crate::{DropReason, DroppedLine, LogError};
use std::io::{self, BufRead, Read};
use std::path::Path;

/// How a line ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LineEnd {
    /// With a newline.
    Newline,
    /// With the end of the input.
    EndOfInput,
    /// Longer than the limit: only its beginning was kept, the rest was skipped.
    TooLong,
}

/// Splits input into lines in bounded memory and counts them.
#[derive(Debug)]
pub(crate) struct LineReader<R> {
    input: R,
    limit: usize,
    line: Vec<u8>,
    number: u64,
}

impl<R: BufRead> LineReader<R> {
    /// Lines of at most `limit` bytes.
    pub fn new(input: R, limit: usize) -> Self {
        LineReader { input, limit, line: Vec::new(), number: 0 }
    }

    /// Number of the line read last, from 1.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// The line read last, without its newline.
    pub fn line(&self) -> &[u8] {
        &self.line
    }

    /// Reads the next line into [`LineReader::line`]; `None` at the end of the input.
    pub fn advance(&mut self) -> io::Result<Option<LineEnd>> {
        self.line.clear();
        let mut bounded = self.input.by_ref().take(self.limit as u64 + 1);
        let read = bounded.read_until(b'\n', &mut self.line)?;
        if read == 0 {
            return Ok(None);
        }
        self.number += 1;
        if self.line.last() == Some(&b'\n') {
            self.line.pop();
            return Ok(Some(LineEnd::Newline));
        }
        if read <= self.limit {
            return Ok(Some(LineEnd::EndOfInput));
        }
        self.input.skip_until(b'\n')?;
        Ok(Some(LineEnd::TooLong))
    }
}

/// What is wrong with a line: the field, from 1, and why.
pub(crate) type LineProblem = (Option<usize>, DropReason);

/// Longest line of a small text file, bytes.
const LINE_LIMIT: usize = 4096;

/// Reads a text file of one value a line; `parse` gives `None` for lines that hold none.
///
/// # Errors
/// [`LogError::Line`] at the first line that cannot be parsed; [`LogError::Read`] when reading
/// fails.
pub(crate) fn read_lines<T>(
    input: impl BufRead,
    file: &Path,
    parse: impl Fn(&[u8]) -> Result<Option<T>, LineProblem>,
) -> Result<Vec<T>, LogError> {
    let mut lines = LineReader::new(input, LINE_LIMIT);
    let mut values = Vec::new();
    loop {
        let number = lines.number();
        let end = lines.advance().map_err(|source| LogError::read(file, number, source))?;
        let Some(end) = end else { return Ok(values) };
        let parsed = match end {
            LineEnd::TooLong => Err((None, DropReason::TooLong { limit: LINE_LIMIT })),
            _ => parse(lines.line()),
        };
        match parsed {
            Ok(value) => values.extend(value),
            Err((field, reason)) => {
                let line = DroppedLine { line: lines.number(), field, reason };
                return Err(LogError::Line { file: file.to_owned(), line });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_counts_and_bounds() {
        let input = b"one\n\nthis line is too long\nfour\nlast";
        let mut lines = LineReader::new(&input[..], 8);
        let mut got = Vec::new();
        while let Some(end) = lines.advance().unwrap() {
            got.push((lines.number(), lines.line().to_vec(), end));
        }
        let expected = [
            (1, b"one".to_vec(), LineEnd::Newline),
            (2, b"".to_vec(), LineEnd::Newline),
            (3, b"this line".to_vec(), LineEnd::TooLong),
            (4, b"four".to_vec(), LineEnd::Newline),
            (5, b"last".to_vec(), LineEnd::EndOfInput),
        ];
        assert_eq!(got, expected);
    }

    #[test]
    fn a_line_without_end_takes_no_memory() {
        let endless = io::repeat(b'7').take(1 << 28);
        let mut lines = LineReader::new(io::BufReader::new(endless), 1 << 16);
        assert_eq!(lines.advance().unwrap(), Some(LineEnd::TooLong));
        assert!(lines.line.capacity() <= 1 << 18);
        assert_eq!(lines.advance().unwrap(), None);
    }
}
