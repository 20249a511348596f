//! Writes the logs of a team on a campus (`robot-00.clf`, ...) and their truth
//! (`robot-00.truth.tum`, ..., one world frame).
//!
//! ```sh
//! cargo run --release -p manifoldslam-synthetic --example campus -- FOLDER ROBOTS [SEED]
//! ```

use manifoldslam_synthetic::{Campus, write_carmen, write_truth};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

const USAGE: &str = "usage: campus FOLDER ROBOTS [SEED]";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or(USAGE)?);
    let robots: u16 = arguments.next().ok_or(USAGE)?.parse()?;
    let seed: u64 = arguments.next().map_or(Ok(1), |seed| seed.parse())?;
    std::fs::create_dir_all(&folder)?;
    let campus = Campus::new(seed, robots);
    for number in 0..campus.robots() {
        let Some(run) = campus.run(number) else { continue };
        let create =
            |ending: &str| File::create(folder.join(format!("robot-{number:02}.{ending}")));
        let mut log = BufWriter::new(create("clf")?);
        write_carmen(&run, &mut log)?;
        log.flush()?;
        let mut truth = BufWriter::new(create("truth.tum")?);
        write_truth(&run, &mut truth)?;
        truth.flush()?;
        println!("robot-{number:02} {:>5} scans {:>4.0} m", run.truth.len(), run.path_length());
    }
    Ok(())
}
