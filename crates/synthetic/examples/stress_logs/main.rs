//! Writes synthetic CARMEN logs that are hard in the ways real logs are, each with its truth:
//! `NAME.clf`, `NAME.relations` (as the benchmark of Kuemmerle et al. 2009 has them) and
//! `NAME.truth.tum`.
//!
//! ```sh
//! cargo run --release -p manifoldslam-synthetic --example stress_logs -- FOLDER [NAME|VARIANT]...
//! ```
//!
//! A number selects another variant of the scenarios: buildings of the same kind from other seeds.

mod buildings;
mod faults;
mod files;
mod recording;
mod scenarios;

use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder =
        PathBuf::from(arguments.next().ok_or("usage: stress_logs FOLDER [NAME|VARIANT]...")?);
    let (variants, wanted): (Vec<String>, Vec<String>) =
        arguments.partition(|a| a.parse::<u64>().is_ok());
    let variant = variants.first().map_or(Ok(0), |v| v.parse())?;
    std::fs::create_dir_all(&folder)?;
    for (name, make) in scenarios::ALL {
        if wanted.is_empty() || wanted.iter().any(|w| w == name) {
            let scenario = make(variant);
            let log = recording::record(&scenario);
            files::write(&folder, name, &scenario, &log)?;
            let metres: f64 = log.windows(2).map(|w| w[0].truth.distance(&w[1].truth)).sum();
            println!("{name:<14} {:>6} scans {metres:>7.0} m", log.len());
        }
    }
    Ok(())
}
