use crate::Outcome;
use crate::args::{Global, SalvageArgs};
use crate::site_info::patches;
use crate::site_writer::now_unix_ns;
use crate::terminal::{counted, print};
use anyhow::{Result, bail};
use serde::Serialize;
use std::fmt::Write;

/// What a salvage brought.
#[derive(Serialize)]
struct Report {
    lost: Vec<String>,
    repaired: Vec<String>,
    robots: usize,
    patches: usize,
    relations: usize,
    scans: usize,
}

/// Writes what is whole in a damaged manifold file into a new one.
pub fn run(args: &SalvageArgs, global: &Global) -> Result<Outcome> {
    if args.output.exists() {
        bail!("{}: there is a file of that name", args.output.display());
    }
    let salvaged = store::salvage(&args.broken)?;
    salvaged.write(&args.output, env!("CARGO_PKG_VERSION"), now_unix_ns())?;
    let map = &salvaged.site.manifold;
    let report = Report {
        lost: salvaged.lost.iter().map(ToString::to_string).collect(),
        repaired: salvaged.repaired.iter().map(ToString::to_string).collect(),
        robots: map.robots().len(),
        patches: map.patches().len(),
        relations: map.relations().len(),
        scans: salvaged.site.trajectories.iter().map(Vec::len).sum(),
    };
    let mut text = format!(
        "{}: {}, {}, {}, {} with a pose",
        args.output.display(),
        counted(report.robots as u64, "robot"),
        patches(report.patches),
        counted(report.relations as u64, "relation"),
        counted(report.scans as u64, "scan"),
    );
    let _ = report.repaired.iter().try_for_each(|what| write!(text, "\n  repaired: {what}"));
    text.push_str("\n  the new file's history begins here");
    print(global, &text, &report)?;
    // Losses are told even to those who want to hear nothing else.
    report.lost.iter().for_each(|what| eprintln!("lost: {what}"));
    Ok(if report.lost.is_empty() { Outcome::Fine } else { Outcome::DataLost })
}
