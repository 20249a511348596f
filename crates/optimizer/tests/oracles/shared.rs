//! The published graphs, where they are at hand.

use logs::g2o::{Graph, open_g2o};
use manifoldslam_optimizer::{Settings, Status, optimize};
use std::path::PathBuf;

/// Final chi-squared of GTSAM 4.3.0's Levenberg-Marquardt from the files' own start.
const GTSAM: [(&str, f64); 3] = [
    ("intel.g2o", 45.004_233_088_441),
    ("M3500.g2o", 3_549.041_070_062_2),
    ("city10000.g2o", 511.987_450_633_2),
];

#[test]
fn published_graphs_end_at_gtsams_cost() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/pose-graphs");
    for (name, expected) in GTSAM {
        let path = folder.join(name);
        if !path.exists() {
            println!("skipped: {} is missing", path.display());
            continue;
        }
        let Graph::Plane(mut graph) = open_g2o(&path).unwrap().graph else { panic!("a plane") };
        let report = optimize(&mut graph, &Settings::default()).unwrap();
        assert_eq!(report.status, Status::Converged);
        assert!(graph.chi2() <= expected * (1.0 + 1e-9), "{name}: {}", graph.chi2());
    }
}
