//! Cuts a log into overlapping robots in memory and merges them.
use logs::{CarmenReader, LogFile, ReadOptions};
use manifoldslam_slam::{Event, Mapper, Preparation, SlamConfig, Team};
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let overlap: f64 = args[0].parse().unwrap();
    let config = SlamConfig::default();
    let mut team = Team::new(config);
    for spec in &args[1..] {
        let (path, n) = spec.rsplit_once(':').unwrap();
        let n: usize = n.parse().unwrap();
        let file = LogFile::open(std::path::Path::new(path)).unwrap();
        let mut reader = CarmenReader::new(file.input, ReadOptions::default());
        let records: Vec<_> = reader.by_ref().map(|r| r.observation).collect();
        let len = records.len() as f64 / n as f64;
        for k in 0..n {
            let from = ((k as f64 - overlap) * len).max(0.0) as usize;
            let to = (((k + 1) as f64 + overlap) * len).min(records.len() as f64) as usize;
            let start = Instant::now();
            let mut mapper = Mapper::new(config);
            let mut prep = Preparation::new(&config);
            let name = format!("{}-{}", path.rsplit('/').next().unwrap(), k + 1);
            let robot = team.add_robot(&name);
            for o in &records[from..to] {
                let events = mapper.step_prepared(prep.prepare(o.clone()));
                let changes: Vec<_> = events
                    .into_iter()
                    .filter_map(|e| match e {
                        Event::Map(c) => Some(c),
                        _ => None,
                    })
                    .collect();
                team.receive(robot, &changes);
            }
            mapper.conclude();
            let patches = mapper.manifold().patches().len();
            team.join(robot, mapper);
            eprintln!(
                "{name}: {} scans {patches} patches {:.2} s",
                to - from,
                start.elapsed().as_secs_f64()
            );
        }
    }
    let start = Instant::now();
    team.finish();
    for m in team.merges() {
        eprintln!(
            "{:?} {:?} {:?} {:.1e} {} relations",
            m.robots,
            m.state,
            m.evidence,
            m.false_bound,
            m.relations.len()
        );
    }
    eprintln!(
        "finish {:.2} s; islands {:?}",
        start.elapsed().as_secs_f64(),
        team.manifold().islands().iter().map(Vec::len).collect::<Vec<_>>()
    );
}
