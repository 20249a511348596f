//! Writes the tests' story of a site into manifold files: for the fixtures, and to be killed.
//!
//!     site_story write FILE          go on until killed
//!     site_story kill ROUNDS FOLDER  kill that many writers in the folder, check what they leave
//!     site_story fixture FILE.gz     the first twelve steps, compressed

// A test program that cannot go on stops.
#![allow(clippy::unwrap_used)]

#[path = "../tests/oracles/killing.rs"]
mod killing;
// Not all of what the tests share is needed here.
#[allow(dead_code)]
#[path = "../tests/oracles/sites.rs"]
mod sites;

use manifold::Manifold;
use manifoldslam_store::{SqliteStore, Store};
use std::io::Write;
use std::path::Path;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match args[..] {
        ["write", file] => write_until_killed(Path::new(file)),
        ["kill", rounds, folder] => {
            let program = std::env::current_exe().unwrap();
            std::fs::create_dir_all(folder).unwrap();
            let rounds = rounds.parse().unwrap();
            println!("{:?}", killing::kill_writers(&program, Path::new(folder), rounds, 5));
        }
        ["fixture", target] => write_fixture(Path::new(target)),
        _ => panic!("write FILE | kill ROUNDS FOLDER | fixture FILE.gz"),
    }
}

/// Writes the story into a file, from where the file is, until the process is killed. Every step
/// that is on disk is told on standard output.
fn write_until_killed(file: &Path) {
    let (mut map, mut scans) = (Manifold::new(), [0; 3]);
    let mut number = 0;
    loop {
        let mut store = if file.exists() {
            SqliteStore::open(file, "story").unwrap()
        } else {
            SqliteStore::create(file, "story").unwrap()
        };
        while number < store.site().steps.len() {
            sites::next_step(&mut map, &mut scans, number);
            number += 1;
        }
        for _ in 0..killing::CLOSE_EVERY {
            store.write(&sites::next_step(&mut map, &mut scans, number)).unwrap();
            number += 1;
            let mut out = std::io::stdout().lock();
            writeln!(out, "{number}").and_then(|()| out.flush()).unwrap();
        }
        store.close().unwrap();
    }
}

fn write_fixture(target: &Path) {
    let file = target.with_extension("tmp");
    let mut store = SqliteStore::create(&file, "fixture").unwrap();
    sites::story(12).0.iter().for_each(|step| store.write(step).unwrap());
    store.close().unwrap();
    let output = std::fs::File::create(target).unwrap();
    let mut packed = flate2::write::GzEncoder::new(output, flate2::Compression::best());
    packed.write_all(&std::fs::read(&file).unwrap()).unwrap();
    packed.finish().unwrap();
    std::fs::remove_file(file).unwrap();
}
