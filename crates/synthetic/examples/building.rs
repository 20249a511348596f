//! Writes a drive through a building of two storeys with a ramp as a log with `ATTITUDE` lines
//! (`storeys.clf`) and its truth on the plan (`storeys.truth.tum`). `furnished`: each storey has
//! furniture of its own.
//!
//! ```sh
//! cargo run --release -p manifoldslam-synthetic --example building -- FOLDER SEED [furnished]
//! ```

use manifoldslam_synthetic::{Robot, Storeys, write_carmen, write_truth};
use std::error::Error;
use std::fs::{File, create_dir_all};
use std::io::{BufWriter, Write};
use std::path::PathBuf;

const USAGE: &str = "usage: building FOLDER SEED [furnished]";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or(USAGE)?);
    let seed: u64 = arguments.next().ok_or(USAGE)?.parse()?;
    let furnished_alike = match arguments.next().as_deref() {
        None => true,
        Some("furnished") => false,
        Some(_) => return Err(USAGE.into()),
    };
    let storeys = Storeys { furnished_alike, ..Storeys::default() };
    let driven = storeys.record(&Robot::default(), seed);
    create_dir_all(&folder)?;
    let mut log = BufWriter::new(File::create(folder.join("storeys.clf"))?);
    write_carmen(&driven.run, &mut log)?;
    log.flush()?;
    let mut truth = BufWriter::new(File::create(folder.join("storeys.truth.tum"))?);
    write_truth(&driven.run, &mut truth)?;
    Ok(truth.flush()?)
}
