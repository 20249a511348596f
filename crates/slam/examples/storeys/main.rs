//! Maps drives through buildings of several storeys and compares with the truth: prints a row for
//! every drive, the table of bench/levels.
//!
//! ```sh
//! cargo run --release -p manifoldslam-slam --example storeys -- [KIND]... [FIRST..LAST]
//! ```

mod kinds;
mod score;

use manifoldslam_slam::{Mapper, SlamConfig};
use score::Score;
use std::error::Error;
use synthetic::Robot;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut first, mut last) = (1, 10);
    let mut wanted = Vec::new();
    for argument in std::env::args().skip(1) {
        match argument.split_once("..") {
            Some((from, to)) => (first, last) = (from.parse()?, to.parse()?),
            None => wanted.push(argument),
        }
    }
    println!("{}", Score::HEADER);
    let mut failed = 0;
    for kind in kinds::ALL {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == kind.name) {
            continue;
        }
        for seed in first..=last {
            let driven = kind.storeys.record(&Robot::default(), seed);
            let mut mapper = Mapper::new(SlamConfig::default());
            let mut patch_scans = Vec::new();
            for (scan, observation) in driven.run.observations.iter().enumerate() {
                mapper.step(observation.clone());
                patch_scans.resize(mapper.manifold().patches().len(), scan);
            }
            mapper.finish();
            let score = Score::new(&driven, &mapper, &patch_scans);
            failed += usize::from(!score.passes(kind.storeys.storeys));
            println!("{}", score.row(kind.name, seed));
        }
    }
    println!("{failed} below the bar");
    Ok(())
}
