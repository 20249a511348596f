//! Writes logs in which a robot's data go bad: `KIND-SEED.clf` with its truth,
//! `KIND-SEED.truth.tum`, and which scans are of no use in `KIND-SEED.json`.
//!
//! ```sh
//! cargo run --release -p manifoldslam-synthetic --example mishaps -- FOLDER FIRST_SEED COUNT
//! ```

use manifoldslam_synthetic::{Mishap, mishap, write_carmen, write_truth};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

const USAGE: &str = "usage: mishaps FOLDER FIRST_SEED COUNT";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or(USAGE)?);
    let first: u64 = arguments.next().ok_or(USAGE)?.parse()?;
    let count: u64 = arguments.next().ok_or(USAGE)?.parse()?;
    std::fs::create_dir_all(&folder)?;
    for seed in first..first.saturating_add(count) {
        for kind in Mishap::ALL {
            let case = mishap(kind, seed);
            let name = format!("{}-{seed:03}", kind.name());
            let create = |ending: &str| File::create(folder.join(format!("{name}.{ending}")));
            let mut log = BufWriter::new(create("clf")?);
            write_carmen(&case.run, &mut log)?;
            log.flush()?;
            let mut truth = BufWriter::new(create("truth.tum")?);
            write_truth(&case.run, &mut truth)?;
            truth.flush()?;
            let world = if seed % 2 == 0 { "rooms" } else { "look-alike" };
            let json = format!(
                "{{\"kind\": \"{}\", \"seed\": {seed}, \"world\": \"{world}\", \"bad\": [{}, {}]}}\n",
                kind.name(),
                case.bad.start,
                case.bad.end
            );
            std::fs::write(folder.join(format!("{name}.json")), json)?;
        }
    }
    Ok(())
}
