use crate::Outcome;
use crate::args::{Global, MapArgs};
use crate::config::Config;
use crate::islands::map_file;
use crate::metrics::Metrics;
use crate::result::write_result;
use crate::result_folder::ResultFolder;
use crate::team::{LogSource, canonical, map_team};
use crate::terminal::print;
use anyhow::{Result, bail};
use logs::LogFile;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// Maps all logs into one result folder, or each into its own.
pub fn run(args: &MapArgs, global: &Global) -> Result<Outcome> {
    let config = Config::load(&args.config)?;
    let sources = canonical(args.logs.iter().map(|log| LogSource::of_file(log)).collect())?;
    // Missing logs and unwritable folders show before hours of mapping, not after.
    for log in &args.logs {
        LogFile::open(log)?;
    }
    if args.separately {
        return map_separately(args, sources, &config, global);
    }
    let folder = ResultFolder::create(&args.output)?;
    let (metrics, lossy) = map_together(sources, folder, &config, global)?;
    let text = format!("{}\n{}", metrics.to_text(), where_to_look(&args.output, &metrics));
    print(global, &text, &metrics)?;
    outcome(lossy, &metrics.failures)
}

fn map_separately(
    args: &MapArgs,
    sources: Vec<LogSource>,
    config: &Config,
    global: &Global,
) -> Result<Outcome> {
    let mut jobs = Vec::new();
    for source in sources {
        let target = args.output.join(&source.name);
        jobs.push((source, ResultFolder::create(&target)?, target));
    }
    let (mut lossy, mut text, mut all) = (false, String::new(), Vec::new());
    let mut failures = Vec::new();
    for (source, folder, target) in jobs {
        // One bad log must not cost the others theirs.
        match map_together(vec![source], folder, config, global) {
            Ok((metrics, is_lossy)) => {
                lossy |= is_lossy;
                let where_ = where_to_look(&target, &metrics);
                let _ = writeln!(text, "{}\n{where_}", metrics.to_text());
                all.push(metrics);
            }
            Err(error) => failures.push(format!("{error:#}")),
        }
    }
    if !all.is_empty() {
        print(global, &text, &all)?;
    }
    outcome(lossy, &failures)
}

/// Maps logs into a folder; true beside the figures when some of them was lost.
fn map_together(
    sources: Vec<LogSource>,
    folder: ResultFolder,
    config: &Config,
    global: &Global,
) -> Result<(Metrics, bool)> {
    let start = Instant::now();
    let mapped = map_team(sources, config, global)?;
    let metrics = write_result(folder, &mapped, config, start)?;
    Ok((metrics, mapped.is_lossy()))
}

fn outcome(lossy: bool, failures: &[String]) -> Result<Outcome> {
    if !failures.is_empty() {
        bail!("{}", failures.join("\n"));
    }
    Ok(if lossy { Outcome::DataLost } else { Outcome::Fine })
}

/// Where the eyes should go.
pub fn where_to_look(target: &Path, metrics: &Metrics) -> String {
    let at = |name: &str| target.join(name).display().to_string();
    let last = metrics.islands.len().saturating_sub(1);
    let more = match last {
        0 => String::new(),
        k => format!(" to {}", map_file(k, "png")),
    };
    format!("  map: {}{more}   report: {}", at("map.png"), at("report.html"))
}
