use crate::carmen_line::{self, Message};
use crate::landmark_line::SightingLine;
use crate::lines::{LineEnd, LineReader};
use crate::number::{is_blank, parse_f64};
use geometry::Pose2;
use std::collections::BTreeMap;
use std::io::{self, BufRead};
use std::ops::Range;

/// What one of the robots gets of a log that is cut into pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Its scans, counted from 0 as the reader hands them out.
    pub scans: Range<usize>,
    /// Carries poses of the log's odometry into the piece's own; the identity leaves lines as they
    /// are.
    pub piece_from_odom: Pose2,
}

/// How a CARMEN log is cut into the logs of several robots.
///
/// Scans go to the pieces that hold them. `ODOM`, `ATTITUDE`, `SYNC` and `TRUEPOS` lines go with
/// the scan that follows them (the last ones with the last scan), `LANDMARK` lines with the pieces
/// that get it; repetitions of a scan under another name go
/// with that scan; `PARAM` lines and comments go to every piece that is not over, so that a piece
/// knows its mountings. All poses are carried into the piece's frame. What else a log may hold is
/// left out and counted: nothing here reads it, and it may tell a position in the old frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut<'a> {
    /// The pieces, in the log's order.
    pub pieces: &'a [Piece],
    /// Line of every scan of the log, from 1, as [`crate::LogRecord::line`] tells it.
    pub scan_lines: &'a [u64],
    /// Lines to read: as many as the reader got ([`crate::ReadReport::lines`]).
    pub lines: u64,
    /// Deal scans that several pieces hold to them in turn, instead of giving them to each.
    pub alternate: bool,
    /// Longer lines are left out, as the reader leaves them out, bytes.
    pub line_limit: usize,
}

/// What became of a log's lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CutReport {
    /// Scans written to each piece.
    pub scans: Vec<usize>,
    /// Messages left out, by name.
    pub left_out: BTreeMap<String, u64>,
}

/// The scans of each of `count` pieces: equal shares in the log's order, widened to both sides by
/// `overlap` of a share, so that neighbours have ground in common.
pub fn shares(scans: usize, count: usize, overlap: f64) -> Vec<Range<usize>> {
    let share = scans as f64 / count.max(1) as f64;
    let at = |x: f64| ((x * share).round().max(0.0) as usize).min(scans);
    (0..count).map(|k| k as f64).map(|k| at(k - overlap)..at(k + 1.0 + overlap)).collect()
}

impl Cut<'_> {
    /// Cuts a log; `write` gets a piece's index and a line for it with its newline.
    ///
    /// # Errors
    /// Those of reading `input` and those of `write`.
    pub fn run(
        &self,
        input: impl BufRead,
        mut write: impl FnMut(usize, &[u8]) -> io::Result<()>,
    ) -> io::Result<CutReport> {
        let mut lines = LineReader::new(input, self.line_limit);
        let scans = vec![0; self.pieces.len()];
        let mut report = CutReport { scans, ..CutReport::default() };
        let (mut next, mut last_owners) = (0, Vec::new());
        while lines.number() < self.lines {
            let Some(end) = lines.advance()? else { break };
            let complete = end == LineEnd::Newline;
            let line = lines.line();
            if end == LineEnd::TooLong || line.iter().all(|&b| is_blank(b)) {
                continue;
            }
            // What cannot be parsed has been reported by the reader.
            let Ok(message) = carmen_line::parse(line, complete) else { continue };
            if self.scan_lines.get(next) == Some(&lines.number()) {
                last_owners = self.owners(next);
                last_owners.iter().for_each(|&piece| report.scans[piece] += 1);
                next += 1;
            } else if matches!(message, Message::Laser(_)) && last_owners.is_empty() {
                continue;
            }
            let (owners, poses) = match message {
                Message::Nothing | Message::Param { .. } => (self.not_over(next), 0..0),
                Message::Laser(laser) => (last_owners.clone(), fields(laser.pose_field, 2)),
                Message::Odometry(_) => (self.holding(next), fields(1, 1)),
                Message::Landmark(seen) => (self.owners(next), fields(pose_field(&seen), 1)),
                Message::Other("TRUEPOS") => (self.holding(next), fields(1, 2)),
                Message::Attitude(_) | Message::Other("SYNC") => (self.holding(next), 0..0),
                Message::Other(name) => {
                    *report.left_out.entry(name.to_owned()).or_default() += 1;
                    continue;
                }
            };
            for piece in owners {
                if let Some(mut text) = reframe(line, &poses, &self.pieces[piece].piece_from_odom) {
                    text.push(b'\n');
                    write(piece, &text)?;
                }
            }
        }
        Ok(report)
    }

    /// Pieces that hold a scan; after the last scan those that hold the last.
    fn holding(&self, scan: usize) -> Vec<usize> {
        let scan = scan.min(self.scan_lines.len().saturating_sub(1));
        self.select(|piece| piece.scans.contains(&scan))
    }

    /// Pieces that get a scan.
    fn owners(&self, scan: usize) -> Vec<usize> {
        let holding = self.holding(scan);
        match holding.len() {
            0 | 1 => holding,
            _ if !self.alternate => holding,
            count => vec![holding[scan % count]],
        }
    }

    /// Pieces with scans still to come.
    fn not_over(&self, next: usize) -> Vec<usize> {
        self.select(|piece| piece.scans.end > next)
    }

    fn select(&self, wanted: impl Fn(&Piece) -> bool) -> Vec<usize> {
        (0..self.pieces.len()).filter(|&i| wanted(&self.pieces[i])).collect()
    }
}

/// The field of a landmark's line in which its odometry begins.
fn pose_field(seen: &SightingLine) -> usize {
    if seen.sighting.yaw.is_some() { 10 } else { 8 }
}

/// The fields of so many poses from `first` on.
fn fields(first: usize, poses: usize) -> Range<usize> {
    first..first + 3 * poses
}

/// A line with the poses in `fields` carried into another frame; `None` when they are no poses.
/// Metres and radians are written with nine decimals: a thousandth of what logs have.
fn reframe(line: &[u8], fields: &Range<usize>, new_from_old: &Pose2) -> Option<Vec<u8>> {
    if fields.is_empty() || *new_from_old == Pose2::IDENTITY {
        return Some(line.to_vec());
    }
    let spans = field_spans(line);
    let spans = spans.get(fields.clone())?;
    let mut text = line[..spans.first()?.start].to_vec();
    let mut written = Vec::new();
    for pose in spans.chunks(3) {
        let number = |span: &Range<usize>| parse_f64(&line[span.clone()]).filter(|v| v.is_finite());
        let [x, y, yaw] = [number(pose.first()?)?, number(pose.get(1)?)?, number(pose.get(2)?)?];
        let pose = *new_from_old * Pose2::new(x, y, yaw);
        written.push(format!("{:.9} {:.9} {:.9}", pose.x, pose.y, pose.yaw));
    }
    text.extend_from_slice(written.join(" ").as_bytes());
    text.extend_from_slice(&line[spans.last()?.end..]);
    Some(text)
}

/// Where the fields of a line are.
fn field_spans(line: &[u8]) -> Vec<Range<usize>> {
    let mut spans = Vec::new();
    let mut start = 0;
    for end in (0..line.len()).filter(|&i| is_blank(line[i])).chain([line.len()]) {
        if end > start {
            spans.push(start..end);
        }
        start = end + 1;
    }
    spans
}
