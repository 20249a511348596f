//! Logs no robot should write: no panic, a finite pose for every scan.

use crate::runs::{assert_finite, ate, building, map};
use geometry::Pose2;
use manifoldslam_slam::{Mapper, SlamConfig};
use sensing::{LaserModel, Observation, Scan, Stamp};

const SCANS: usize = 120;

fn log() -> Vec<Observation> {
    building().observations[..SCANS].to_vec()
}

/// Maps the log: as many finite poses as scans; returns the ATE.
fn survive(log: &[Observation]) -> f64 {
    let mapped = map(SlamConfig::default(), log);
    assert_finite(&mapped.trajectory);
    let patches: Vec<Pose2> =
        mapped.manifold.patches().iter().map(|p| p.island_from_patch).collect();
    assert_finite(&patches);
    for relation in mapped.manifold.relations() {
        assert!(relation.from_from_to.covariance.iter().all(|v| v.is_finite()));
        assert!(relation.from_from_to.covariance.cholesky().is_some(), "{relation:?}");
    }
    ate(&building().truth[..log.len()], &mapped.trajectory)
}

fn readings(scan: &Scan) -> Vec<f32> {
    (0..scan.len()).map(|i| scan.hit(i).unwrap_or(f32::INFINITY)).collect()
}

#[test]
fn a_mapper_that_saw_nothing_finishes() {
    let mut mapper = Mapper::new(SlamConfig::default());
    assert!(mapper.finish().is_empty());
    assert!(mapper.finish().is_empty());
    assert!(mapper.trajectory().is_empty() && mapper.manifold().patches().is_empty());
}

#[test]
fn one_scan_is_a_map() {
    let mapped = map(SlamConfig::default(), &log()[..1]);
    assert!(
        mapped.trajectory.len() == 1 && mapped.trajectory[0].norm() < 1e-3,
        "{:?}",
        mapped.trajectory
    );
    assert_eq!(mapped.manifold.patches().len(), 1);
}

#[test]
fn scans_without_a_hit_are_lived_through() {
    let laser = LaserModel::half_circle(181);
    let blind = [
        Scan::classify(laser, &[]),
        Scan::classify(laser, &[f32::NAN; 181]),
        Scan::classify(laser, &[f32::INFINITY; 181]),
        Scan::classify(laser, &[0.0; 181]),
        Scan::classify(laser, &[1.0]),
    ];
    for scan in &blind {
        for (from, to) in [(0, SCANS), (0, 3), (60, 63), (110, SCANS)] {
            let mut log = log();
            for observation in &mut log[from..to] {
                observation.scan = scan.clone();
            }
            let error = survive(&log);
            // Odometry bridges a second; where all is dark nothing is promised.
            assert!(to - from > 10 || error < 0.1, "{from}..{to}: {error}");
        }
    }
}

#[test]
fn a_scanner_that_changes_is_lived_through() {
    let mut log = log();
    for (i, observation) in log.iter_mut().enumerate() {
        let all = readings(&observation.scan);
        let (laser, kept) = match i / 30 {
            0 => continue,
            1 => (LaserModel::half_circle(91), all.iter().copied().step_by(2).collect()),
            2 => (LaserModel::half_circle(3), all.iter().copied().step_by(90).collect()),
            _ => (LaserModel::half_circle(181), all),
        };
        observation.scan = Scan::classify(laser, &kept);
    }
    let error = survive(&log);
    assert!(error < 0.3, "{error}");
}

#[test]
fn stamps_are_never_believed() {
    let straight = survive(&log());
    assert!(straight < 0.03, "{straight}");
    let mut back = log();
    for (i, observation) in back.iter_mut().enumerate() {
        if i % 17 == 3 {
            observation.stamp = Stamp(observation.stamp.0 - 5_000_000_000);
        }
    }
    let mut wild = log();
    for (i, observation) in wild.iter_mut().enumerate() {
        observation.stamp = [Stamp(i64::MIN), Stamp(i64::MAX), Stamp(0)][i % 3];
    }
    let mut equal = log();
    equal.iter_mut().for_each(|o| o.stamp = Stamp(0));
    for log in [back, wild, equal] {
        let error = survive(&log);
        assert!(error < 0.03, "{error}");
    }
}

#[test]
fn observations_that_come_twice_change_nothing_much() {
    let twice: Vec<Observation> = log().into_iter().flat_map(|o| [o.clone(), o]).collect();
    let mapped = map(SlamConfig::default(), &twice);
    assert_finite(&mapped.trajectory);
    for pair in mapped.trajectory.chunks(2) {
        assert!(pair[0].distance(&pair[1]) < 0.02, "{pair:?}");
    }
    let odd: Vec<Pose2> = mapped.trajectory.iter().copied().step_by(2).collect();
    let error = ate(&building().truth[..SCANS], &odd);
    assert!(error < 0.03, "{error}");
}

#[test]
fn garbage_odometry_is_lived_through() {
    for value in [1e12, -1e300, f64::NAN, f64::INFINITY] {
        let mut log = log();
        for observation in log.iter_mut().skip(50).step_by(7) {
            observation.odom_from_base = Some(Pose2 { x: value, y: 0.0, yaw: value });
        }
        let error = survive(&log);
        assert!(error < 0.03, "odometry of {value}: {error}");
    }
}
