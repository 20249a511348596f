use crate::Outcome;
use crate::args::Global;
use crate::benchmark::args::MatchersArgs;
use crate::benchmark::contender::Contender;
use crate::benchmark::situations::{Place, noise};
use crate::benchmark::{
    Comparison, basins, csv, degenerate, own_scans, pictures, real_log, rooms, tables,
};
use crate::result_folder::{METRICS, ResultFolder};
use crate::terminal::{print, progress};
use anyhow::Result;
use std::path::Path;
use synthetic::Situation;

/// Compares scan matchers.
pub fn matchers(args: &MatchersArgs, global: &Global) -> Result<Outcome> {
    let folder = args.output.as_deref().map(ResultFolder::create).transpose()?;
    let contenders = Contender::named(&args.matcher);
    let places = places(args, &contenders)?;
    let (pairs, lossy) = match &args.log {
        Some(log) => real_log::read_pairs(log, usize::from(args.pairs))?,
        None => (Vec::new(), false),
    };
    let with_basins = folder.is_some() && !args.no_basins && !places.is_empty();
    let count = matches(args, &places, pairs.len(), with_basins) * contenders.len() as u64;
    let bar = progress(global, count, "matching {wide_bar} {percent:>3} % {msg} {eta}");

    let mut comparison = Comparison {
        noise: noise_in_words(args),
        seed: args.seed,
        repeats: usize::from(args.repeats),
        situations: places.iter().map(|place| place.compare(&contenders, &bar)).collect(),
        ..Comparison::default()
    };
    if args.wants("rooms") {
        comparison.accuracy.push(rooms::rooms(args, &contenders, &bar));
    }
    if args.wants("submap") {
        comparison.accuracy.push(rooms::submap(args, &contenders, &bar));
    }
    if args.wants("degenerate") {
        comparison.degenerate = degenerate::degenerate(args, &contenders, &bar);
    }
    if let Some(log) = &args.log {
        let name = crate::mapping::stem(log);
        comparison.log = Some(real_log::agree(&name, &pairs, &contenders, &bar));
    }
    let heat = if with_basins { Some(basins::draw(&places, &contenders, &bar)?) } else { None };
    bar.finish_and_clear();

    let sections = tables::sections(&comparison);
    let mut text: String = sections.iter().map(|s| s.to_text() + "\n").collect();
    if let Some(folder) = folder {
        let markdown: Vec<String> = sections.iter().map(tables::Section::to_markdown).collect();
        write(folder, &comparison, &places, &markdown.join("\n"), heat)?;
        text += &where_to_look(args.output.as_deref(), &places);
    }
    print(global, &text, &comparison)?;
    Ok(if lossy { Outcome::DataLost } else { Outcome::Fine })
}

/// Where the protocol is run.
fn places(args: &MatchersArgs, contenders: &[Contender]) -> Result<Vec<Place>> {
    if let Some(names) = &args.scans {
        return Ok(vec![own_scans::place(names, args.truth, contenders)?]);
    }
    let wanted = Situation::ALL.into_iter().filter(|situation| args.wants(situation.name()));
    Ok(wanted.map(|situation| Place::of_situation(situation, args)).collect())
}

/// How many matches one matcher will make.
fn matches(args: &MatchersArgs, places: &[Place], pairs: usize, with_basins: bool) -> u64 {
    let of = |name: &str, share: u64| u64::from(args.wants(name)) * share * u64::from(args.rooms);
    let protocol: u64 = places.iter().map(Place::matches).sum();
    let basins = if with_basins { basins::TRIALS * places.len() as u64 } else { 0 };
    protocol + basins + pairs as u64 + of("rooms", 1) + of("submap", 1) + of("degenerate", 2)
}

fn noise_in_words(args: &MatchersArgs) -> String {
    let noise = noise(args);
    match args.noise {
        Some(std) => format!("{:.1} mm, Gaussian", 1e3 * std),
        None => format!("up to {:.1} % of the range, as USARSim's", 100.0 * noise.relative),
    }
}

fn write(
    folder: ResultFolder,
    comparison: &Comparison,
    places: &[Place],
    markdown: &str,
    heat: Option<Vec<u8>>,
) -> Result<()> {
    folder.write("matchers.md", format!("# Scan matchers compared\n\n{markdown}").as_bytes())?;
    if !places.is_empty() {
        folder.write("matchers.csv", csv::matchers(comparison).as_bytes())?;
        folder.write("scans.png", &pictures::scans(places)?)?;
        folder.write("errors.png", &pictures::errors(comparison)?)?;
        folder.write("error-time.png", &pictures::error_time(comparison)?)?;
    }
    if let Some(heat) = heat {
        folder.write("basins.png", &heat)?;
    }
    for (name, text) in [
        ("accuracy.csv", csv::accuracy(comparison)),
        ("degenerate.csv", csv::degenerate(comparison)),
        ("log.csv", csv::log(comparison)),
    ] {
        // More than a header.
        if text.lines().nth(1).is_some() {
            folder.write(name, text.as_bytes())?;
        }
    }
    folder.write(METRICS, &serde_json::to_vec_pretty(comparison)?)?;
    folder.commit()
}

fn where_to_look(output: Option<&Path>, places: &[Place]) -> String {
    let Some(output) = output else { return String::new() };
    let at = |name: &str| output.join(name).display().to_string();
    let pictures =
        if places.is_empty() { String::new() } else { format!("   plots: {}", at("*.png")) };
    format!("tables: {}{pictures}\n", at("matchers.md"))
}
