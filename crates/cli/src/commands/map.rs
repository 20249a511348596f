use crate::Outcome;
use crate::args::{ConfigArgs, Global, MapArgs};
use crate::bad_data::warn;
use crate::config::Config;
use crate::islands::map_file;
use crate::mapping::{LogSource, canonical, map_new, map_onto, stored_config};
use crate::metrics::Metrics;
use crate::result::{figures, write_result};
use crate::result_folder::{CONFIG, ResultFolder, SITE, folder_of, is_same, result_folder_of};
use crate::terminal::print;
use anyhow::{Context, Result, bail};
use logs::LogFile;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;
use store::{SqliteStore, Store};

/// Maps all logs into one result folder, or each into its own, or onto a map that is there.
pub fn run(args: &MapArgs, global: &Global) -> Result<Outcome> {
    let sources = canonical(args.logs.iter().map(|log| LogSource::of_file(log)).collect())?;
    // Missing logs and unwritable folders show before hours of mapping, not after.
    for log in &args.logs {
        LogFile::open(log)?;
    }
    if let Some(site) = &args.onto {
        return map_onto_site(site, args, sources, global);
    }
    let config = Config::load(&args.config)?;
    let output = args.output.as_deref().context("name a result folder: -o DIR")?;
    if args.separately {
        return map_separately(output, sources, &config, global);
    }
    let folder = ResultFolder::create(output)?;
    let (metrics, lossy) = map_together(sources, folder, &config, global)?;
    let text = format!("{}\n{}", metrics.to_text(), where_to_look(output, &metrics));
    print(global, &text, &metrics)?;
    outcome(lossy, &metrics.failures)
}

/// Adds logs to the map in a manifold file.
fn map_onto_site(
    file: &Path,
    args: &MapArgs,
    sources: Vec<LogSource>,
    global: &Global,
) -> Result<Outcome> {
    let start = Instant::now();
    let folder = match &args.output {
        Some(output) if !is_same(output, folder_of(file)) => Some(ResultFolder::create(output)?),
        _ => result_folder_of(file)?,
    };
    let output = folder.as_ref().map(|folder| folder.target().to_owned());
    let store = SqliteStore::open(file, env!("CARGO_PKG_VERSION"))?;
    let config = match (args.config == ConfigArgs::default(), stored_config(store.site())?) {
        (true, Some(stored)) => stored,
        _ => Config::load(&args.config)?,
    };
    let (mapped, site) = map_onto(sources, store, &config, global)?;
    let mut text = String::new();
    let metrics = match folder {
        Some(mut folder) => {
            folder.keep();
            write_result(folder, &mapped, &config, start, site)?
        }
        None => figures(&mapped, &config, start, site)?,
    };
    warn(&metrics);
    let _ = write!(text, "{}\n  manifold file: {}", metrics.to_text(), file.display());
    if let Some(output) = output {
        let _ = write!(text, "\n{}", where_to_look(&output, &metrics));
    }
    print(global, &text, &metrics)?;
    outcome(mapped.is_lossy(), &metrics.failures)
}

fn map_separately(
    output: &Path,
    sources: Vec<LogSource>,
    config: &Config,
    global: &Global,
) -> Result<Outcome> {
    let mut jobs = Vec::new();
    for source in sources {
        let target = output.join(&source.name);
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
    mut folder: ResultFolder,
    config: &Config,
    global: &Global,
) -> Result<(Metrics, bool)> {
    let start = Instant::now();
    folder.write(CONFIG, config.to_toml().as_bytes())?;
    let (mapped, site) = map_new(sources, &folder.path(SITE), config, global)?;
    folder.keep();
    let metrics = write_result(folder, &mapped, config, start, site)?;
    warn(&metrics);
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
