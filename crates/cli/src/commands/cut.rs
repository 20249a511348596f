use crate::Outcome;
use crate::args::Global;
use crate::atomic::PendingFile;
use crate::mapping::{LogFacts, stem};
use crate::terminal::{counted, print};
use anyhow::{Context, Result, bail};
use clap::Args;
use geometry::Pose2;
use logs::{CarmenReader, Cut, LogFile, Piece, ReadOptions, ReadReport, shares};
use rand::{Rng, SeedableRng, rngs::StdRng};
use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fs;
use std::io::Write;
use std::path::PathBuf;

/// A piece's odometry begins somewhere within this of where the log's was, along x and y, metres:
/// far outside any building of the logs at hand, so that no frame is near another by chance.
const FRAME_SPREAD_M: f64 = 500.0;

/// Arguments of `cut`.
#[derive(Debug, Args)]
#[command(
    after_help = "Piece k holds the k-th of N equal shares of the scans, in the log's order, and on both sides \
    --overlap of a share more, so that neighbours have ground in common. Each piece's odometry is carried into a \
    frame of its own, drawn from --seed; from line to line it is what it was. Stamps and readings are kept digit \
    by digit. Messages that nothing here reads are left out: they may tell where the robot was.\n\n\
    Examples:\n  \
    manifoldslam cut intel.clf.bz2 --pieces 3 -o out/three\n  \
    manifoldslam cut aces.clf.bz2 --pieces 2 --overlap 0.3 --alternate --seed 7 -o out/two\n  \
    manifoldslam map out/three/*.clf -o out/together"
)]
pub struct CutArgs {
    /// CARMEN log: plain, gzip or bzip2
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// How many pieces
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pieces: u16,
    /// What a piece holds beyond its share, on each side, as a part of a share
    #[arg(long, value_name = "SHARE", default_value_t = 0.15, value_parser = overlap)]
    overlap: f64,
    /// Deal the scans of an overlap to the two pieces in turn [default: both get all of them]
    #[arg(long)]
    alternate: bool,
    /// Seed of the pieces' frames
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Folder for LOG-1.clf to LOG-N.clf; files of these names are replaced
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
}

/// One piece, for the summary.
#[derive(Debug, Serialize)]
struct Written {
    file: String,
    scans: usize,
    first_scan: usize,
    end_scan: usize,
}

#[derive(Debug, Serialize)]
struct Summary {
    pieces: Vec<Written>,
    left_out: BTreeMap<String, u64>,
    dropped_lines: u64,
}

/// Cuts a log.
pub fn run(args: &CutArgs, global: &Global) -> Result<Outcome> {
    let (scan_lines, has_odometry, report) = survey(args)?;
    let pieces = pieces(args, scan_lines.len(), has_odometry);
    fs::create_dir_all(&args.output)
        .with_context(|| format!("{}: cannot create the folder", args.output.display()))?;
    let stem = stem(&args.log);
    let paths: Vec<PathBuf> =
        (1..=pieces.len()).map(|k| args.output.join(format!("{stem}-{k}.clf"))).collect();
    let mut files = Vec::new();
    for path in &paths {
        let file = PendingFile::create(path)?;
        files.push((file.writer()?, file));
    }
    let cut = Cut {
        pieces: &pieces,
        scan_lines: &scan_lines,
        lines: report.lines,
        alternate: args.alternate,
        line_limit: ReadOptions::default().line_limit,
    };
    let done = cut
        .run(LogFile::open(&args.log)?.input, |piece, line| files[piece].0.write_all(line))
        .with_context(|| format!("{}: cannot cut", args.log.display()))?;
    for ((mut writer, file), path) in files.into_iter().zip(&paths) {
        writer.flush().with_context(|| format!("{}: cannot write", path.display()))?;
        file.publish()?;
    }
    let written = paths.iter().zip(&pieces).zip(&done.scans).map(|((path, piece), &scans)| {
        let file = path.display().to_string();
        Written { file, scans, first_scan: piece.scans.start, end_scan: piece.scans.end }
    });
    let left_out = done.left_out;
    let summary =
        Summary { pieces: written.collect(), left_out, dropped_lines: report.dropped_count };
    print(global, &to_text(&summary, &report), &summary)?;
    Ok(if report.is_lossy() { Outcome::DataLost } else { Outcome::Fine })
}

/// Reads the log as `map` does: the line of every scan, and whether there is any odometry.
fn survey(args: &CutArgs) -> Result<(Vec<u64>, bool, ReadReport)> {
    let mut reader = CarmenReader::open(&args.log, ReadOptions::default())?;
    let (mut lines, mut has_odometry) = (Vec::new(), false);
    for record in reader.by_ref() {
        lines.push(record.line);
        has_odometry |= record.observation.odom_from_base.is_some();
    }
    let report = reader.finish();
    let (log, wanted) = (args.log.display(), args.pieces);
    if lines.is_empty() {
        bail!("{log}: no scan in it{}", LogFacts::new(&report, 0.0).first_problems());
    }
    if lines.len() < usize::from(wanted) {
        let scans = counted(lines.len() as u64, "scan");
        bail!("{log}: {scans} cannot make {wanted} pieces; ask for fewer with --pieces");
    }
    Ok((lines, has_odometry, report))
}

/// Each piece with its scans and its frame. A log without odometry (all poses zero) keeps its
/// zeros: moved, they would pass for the odometry of a robot that stands still.
fn pieces(args: &CutArgs, scans: usize, has_odometry: bool) -> Vec<Piece> {
    let mut rng = StdRng::seed_from_u64(args.seed);
    let mut frame = || {
        let mut within = |limit: f64| rng.random_range(-limit..limit);
        let pose = Pose2::new(within(FRAME_SPREAD_M), within(FRAME_SPREAD_M), within(PI));
        if has_odometry { pose } else { Pose2::IDENTITY }
    };
    shares(scans, usize::from(args.pieces), args.overlap)
        .into_iter()
        .map(|scans| Piece { scans, piece_from_odom: frame() })
        .collect()
}

fn to_text(summary: &Summary, report: &ReadReport) -> String {
    let mut text = String::new();
    for piece in &summary.pieces {
        let (scans, last) = (counted(piece.scans as u64, "scan"), piece.end_scan);
        text += &format!("{}: {scans}, from {} to {last}\n", piece.file, piece.first_scan + 1);
    }
    for (name, count) in &summary.left_out {
        text += &format!("left out: {} {name}\n", counted(*count, "message"));
    }
    if report.is_lossy() {
        let lost = counted(report.dropped_count, "dropped line");
        text += &format!("LOST: {lost}{}\n", LogFacts::new(report, 0.0).first_problems());
    }
    text
}

fn overlap(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("must be a number from 0 to 1".into()),
    }
}
