//! Reads a log and prints what is in it: `read_log LOG`.

use manifoldslam_logs::{CarmenReader, ReadOptions};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: read_log LOG")?;
    let start = Instant::now();
    let mut reader = CarmenReader::open(path.as_ref(), ReadOptions::default())?;
    let (mut hits, mut no_returns, mut limits) = (0, 0, Vec::new());
    for record in reader.by_ref() {
        let scan = &record.observation.scan;
        let here = scan.hit_count();
        hits += here;
        no_returns += scan.len() - here;
        if limits.last() != Some(&scan.laser().range_max_m) {
            limits.push(scan.laser().range_max_m);
        }
    }
    println!("{hits} hits, {no_returns} others, maximum ranges {limits:?}");
    println!("{:#?}", reader.finish());
    println!("{:.3} s", start.elapsed().as_secs_f64());
    Ok(())
}
