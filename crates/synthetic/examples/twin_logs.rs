//! Writes cases of look-alike places, each a folder with the robots' logs (`robot0.clf`, ...),
//! their truth (`robot0.truth.tum`, ..., one world frame) and `case.json`.
//!
//! ```sh
//! cargo run --release -p manifoldslam-synthetic --example twin_logs -- FOLDER FIRST_SEED COUNT
//! ```
//!
//! A seed gives two folders for each family: robots apart (two islands) and together (one).

use manifoldslam_synthetic::{Meeting, TwinCase, TwinFamily, twins, write_carmen, write_truth};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

const USAGE: &str = "usage: twin_logs FOLDER FIRST_SEED COUNT";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or(USAGE)?);
    let first: u64 = arguments.next().ok_or(USAGE)?.parse()?;
    let count: u64 = arguments.next().ok_or(USAGE)?.parse()?;
    for seed in first..first.saturating_add(count) {
        for family in TwinFamily::ALL {
            for (meeting, word) in [(Meeting::Apart, "apart"), (Meeting::Together, "together")] {
                let name = format!("{}-{seed:04}-{word}", family.name());
                let case = twins(family, seed, meeting);
                let metres: f64 = case.runs.iter().map(|run| run.path_length()).sum();
                println!("{name:<26} {} robots {metres:>5.0} m", case.runs.len());
                write_case(&folder.join(name), seed, &case)?;
            }
        }
    }
    Ok(())
}

fn write_case(folder: &Path, seed: u64, case: &TwinCase) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    for (number, run) in case.runs.iter().enumerate() {
        let create = |ending: &str| File::create(folder.join(format!("robot{number}.{ending}")));
        let mut log = BufWriter::new(create("clf")?);
        write_carmen(run, &mut log)?;
        log.flush()?;
        let mut truth = BufWriter::new(create("truth.tum")?);
        write_truth(run, &mut truth)?;
        truth.flush()?;
    }
    Ok(std::fs::write(folder.join("case.json"), json(seed, case))?)
}

fn json(seed: u64, case: &TwinCase) -> String {
    let beyond: Vec<String> = case.beyond_m.iter().map(|metres| format!("{metres:.1}")).collect();
    format!(
        "{{\n  \"family\": \"{}\",\n  \"seed\": {seed},\n  \"true_islands\": {},\n  \
         \"buildings\": {:?},\n  \"exact_copy\": {},\n  \"mirrored\": {},\n  \
         \"beyond_m\": [{}],\n  \"beams\": {},\n  \"max_range_m\": {:.1}\n}}\n",
        case.family.name(),
        case.true_islands,
        case.buildings,
        case.part.exact,
        case.part.mirrored,
        beyond.join(", "),
        case.beams,
        case.max_range_m,
    )
}
