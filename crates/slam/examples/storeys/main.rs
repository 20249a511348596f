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
            let mut mapper = Mapper::new({
                let mut c = SlamConfig::default();
                if std::env::var("REL").is_ok() {
                    c.refit.method = manifoldslam_slam::RefitMethod::Relations;
                }
                c
            });
            let mut patch_scans = Vec::new();
            for (scan, observation) in driven.run.observations.iter().enumerate() {
                mapper.step(observation.clone());
                patch_scans.resize(mapper.manifold().patches().len(), scan);
            }
            mapper.finish();
            if std::env::var("DEBUG").is_ok() {
                debug(&driven, &mapper, &patch_scans);
            }
            let score = Score::new(&driven, &mapper, &patch_scans);
            failed += usize::from(!score.passes(kind.storeys.storeys));
            println!("{}", score.row(kind.name, seed));
        }
    }
    println!("{failed} below the bar");
    Ok(())
}

fn debug(driven: &synthetic::StoreysRun, mapper: &Mapper, patch_scans: &[usize]) {
    let t = mapper.trajectory();
    for (i, (a, b)) in driven.run.truth.iter().zip(&t).enumerate().filter(|(i, _)| {
        (450..600).contains(i) && (i % 5 == 0 || (460..490).contains(i))
            || (1160..1290).contains(i) && i % 5 == 0
    }) {
        let w = driven.run.truth[0] * *b;
        println!(
            "{i} z {:.2} true {:.2} {:.2} {:.2} err {:.3} {:.3} {:.4}",
            driven.heights_m[i],
            a.x,
            a.y,
            a.yaw,
            w.x - a.x,
            w.y - a.y,
            w.yaw - a.yaw
        );
    }
    for w in mapper.manifold().ways() {
        let (a, b) = (patch_scans[w.from.index()], patch_scans[w.to.index()]);
        if driven.heights_m[a] < 0.001 && driven.heights_m[b] < 0.001
            || driven.heights_m[a] > 2.99 && driven.heights_m[b] > 2.99
        {
            continue;
        }
        let tr = driven.run.truth[a].between(&driven.run.truth[b]);
        if let Some(m) = w.motion {
            let e = tr.between(&m.mean);
            println!(
                "way {a} {b} {:.2} err {:.3} {:.3} {:.4} std {:.3}",
                tr.x,
                e.x,
                e.y,
                e.yaw,
                m.covariance[(0, 0)].sqrt()
            );
        } else {
            println!("way {a} {b} none");
        }
    }
    for r in mapper.manifold().active_relations() {
        let (a, b) = (patch_scans[r.from.index()], patch_scans[r.to.index()]);
        if !(driven.heights_m[a] < 0.001 && driven.heights_m[b] < 0.001
            || driven.heights_m[a] > 2.99 && driven.heights_m[b] > 2.99)
        {
            let tr = driven.run.truth[a].between(&driven.run.truth[b]);
            let e = tr.between(&r.from_from_to.mean);
            let es = tr.between(
                &(driven.run.truth[0].inverse() * driven.run.truth[a])
                    .between(&(driven.run.truth[0].inverse() * driven.run.truth[b])),
            );
            let est = t[a].between(&t[b]);
            let ee = tr.between(&est);
            let _ = es;
            print!("final {:.3} {:.3} {:.4} ", ee.x, ee.y, ee.yaw);
            println!(
                "rel {a} {b} z {:.2} err {:.3} {:.3} {:.4} std {:.3}",
                driven.heights_m[b],
                e.x,
                e.y,
                e.yaw,
                r.from_from_to.covariance[(0, 0)].sqrt()
            );
        }
        if r.provenance == manifold::Provenance::Sequential {
            continue;
        }
        let (a, b) = (patch_scans[r.from.index()], patch_scans[r.to.index()]);
        let tr = driven.run.truth[a].between(&driven.run.truth[b]);
        let e = tr.between(&r.from_from_to.mean);
        println!(
            "closure {a} {b} z {:.2} {:.2} err {:.3} {:.3} {:.4}",
            driven.heights_m[a], driven.heights_m[b], e.x, e.y, e.yaw
        );
    }
}
