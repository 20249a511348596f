//! Writes a drive through a building of two storeys with a ramp as a log with `ATTITUDE` lines
//! (`storeys.clf`) and its truth on the plan (`storeys.truth.tum`).
//!
//! ```sh
//! cargo run --release -p manifoldslam-synthetic --example building -- FOLDER SEED
//! ```

use manifoldslam_synthetic::{Robot, Storeys, write_carmen, write_truth};
use std::error::Error;
use std::fs::{File, create_dir_all};
use std::io::{BufWriter, Write};
use std::path::PathBuf;

const USAGE: &str = "usage: building FOLDER SEED";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or(USAGE)?);
    let seed: u64 = arguments.next().ok_or(USAGE)?.parse()?;
    let driven = Storeys::default().record(&Robot::default(), seed);
    create_dir_all(&folder)?;
    let mut log = BufWriter::new(File::create(folder.join("storeys.clf"))?);
    write_carmen(&driven.run, &mut log)?;
    log.flush()?;
    let mut truth = BufWriter::new(File::create(folder.join("storeys.truth.tum"))?);
    write_truth(&driven.run, &mut truth)?;
    Ok(truth.flush()?)
}
