//! Cuts logs into overlapping robots in memory, maps each by itself and joins them.
//!
//! `cargo run --release -p manifoldslam-slam --example pieces -- OVERLAP LOG.clf:PIECES...`
//!
//! OVERLAP is the share of a piece's length by which it reaches into its neighbours on either side;
//! the scans there are in both. Every piece starts an island of its own. Several logs may be given,
//! with one piece each for example, to see that different buildings stay apart.

use logs::{CarmenReader, LogFile, ReadOptions};
use manifoldslam_slam::{SlamConfig, Team};
use sensing::Observation;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (overlap, logs) = args.split_first().ok_or("arguments: OVERLAP LOG.clf:PIECES...")?;
    let overlap: f64 = overlap.parse()?;
    let mut team = Team::new(SlamConfig::default());
    for spec in logs {
        let (path, pieces) = spec.rsplit_once(':').ok_or("LOG.clf:PIECES")?;
        let pieces: usize = pieces.parse()?;
        let file = LogFile::open(Path::new(path))?;
        let reader = CarmenReader::new(file.input, ReadOptions::default());
        let scans: Vec<Observation> = reader.map(|record| record.observation).collect();
        let length = scans.len() as f64 / pieces as f64;
        let stem = Path::new(path).file_stem().unwrap_or_default().to_string_lossy();
        for piece in 0..pieces {
            let at = |edge: f64| (edge * length).clamp(0.0, scans.len() as f64) as usize;
            let part = &scans[at(piece as f64 - overlap)..at((piece + 1) as f64 + overlap)];
            map(&mut team, &format!("{stem}-{}", piece + 1), part);
        }
    }
    let start = Instant::now();
    team.finish();
    for m in team.merges() {
        let (evidence, bound, links) = (m.evidence, m.false_bound, m.relations.len());
        println!("{:?} {:?} {evidence:?} {bound:.1e} {links} relations", m.robots, m.state);
    }
    let sizes: Vec<usize> = team.manifold().islands().iter().map(Vec::len).collect();
    println!("{:.2} s; islands of {sizes:?} patches", start.elapsed().as_secs_f64());
    Ok(())
}

/// Maps one robot's scans and takes it into the team.
fn map(team: &mut Team, name: &str, scans: &[Observation]) {
    let start = Instant::now();
    let robot = team.map_robot(name, scans.iter().cloned());
    let own = team.manifold().patches().iter().filter(|patch| patch.robot == robot);
    let patches = own.count();
    let secs = start.elapsed().as_secs_f64();
    println!("{name}: {} scans, {patches} patches, {secs:.2} s", scans.len());
}
