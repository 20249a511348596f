//! Pairs of scans for peers in other languages, and our matchers timed on the same file; the bench
//! in `bench/peers` runs it.
//!
//! ```text
//! cargo run --release -p manifoldslam-matching --example peer_pairs -- write FILE PAIRS [SEED]
//! cargo run --release -p manifoldslam-matching --example peer_pairs -- list
//! cargo run --release -p manifoldslam-matching --example peer_pairs -- time FILE NAME [FROM TO]
//! ```
//!
//! `write` draws PAIRS rooms and from each a pair of every task; `list` prints the names that
//! `time` knows; `time` prints a line for each pair of the file, or of its pairs FROM to TO - 1:
//! index, pose found (`nan` where the matcher itself says that it failed), CPU time in
//! microseconds of the match, of all that has to be built before it, and of adding one scan to a
//! kept reference (`nan` where a matcher keeps none).

mod clock;
#[path = "../common/mod.rs"]
mod common;
mod pair;
mod tasks;
mod timing;

use pair::Pair;
use std::error::Error;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};

const USAGE: &str = "usage: peer_pairs write FILE PAIRS [SEED] | list | time FILE NAME [FROM TO]";
/// Seed of the first room.
const FIRST_SEED: u64 = 5000;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["write", file, pairs] => write(file, pairs.parse()?, FIRST_SEED),
        ["write", file, pairs, seed] => write(file, pairs.parse()?, seed.parse()?),
        ["list"] => {
            timing::names().iter().for_each(|name| println!("{name}"));
            Ok(())
        }
        ["time", file, name] => time(file, name, 0, usize::MAX),
        ["time", file, name, from, to] => time(file, name, from.parse()?, to.parse()?),
        _ => Err(USAGE.into()),
    }
}

fn write(file: &str, rooms: u64, first_seed: u64) -> Result<(), Box<dyn Error>> {
    let mut out = BufWriter::new(File::create(file)?);
    for room in 0..rooms {
        for pair in tasks::pairs(first_seed + room) {
            out.write_all(pair.to_text().as_bytes())?;
        }
    }
    Ok(out.flush()?)
}

fn time(file: &str, name: &str, from: usize, to: usize) -> Result<(), Box<dyn Error>> {
    let mut contestant = timing::contestant(name).ok_or_else(|| format!("no matcher {name}"))?;
    let mut lines = BufReader::new(File::open(file)?).lines();
    for index in 0..to {
        let Some(pair) = Pair::read(&mut lines).map_err(|e| format!("pair {index}: {e}"))? else {
            break;
        };
        if index < from {
            continue;
        }
        let t = contestant(&pair);
        let [x, y, yaw] = t.pose.map_or([f64::NAN; 3], |p| [p.x, p.y, p.yaw]);
        println!("{index} {x} {y} {yaw} {} {} {}", t.align_us, t.build_us, t.update_us);
    }
    Ok(())
}
