//! A building whose two storeys have the same plan and furniture, joined by a ramp, driven with an
//! inertial unit that has a bias: what the heights are worth.

use crate::runs::{Mapped, ate, map};
use geometry::Pose2;
use manifold::{Patch, PatchId, Provenance};
use manifoldslam_slam::{Mapper, SlamConfig, Team};
use sensing::{Observation, RobotId};
use std::collections::BTreeMap;
use std::sync::OnceLock;
use synthetic::{Robot, Storeys, StoreysRun};

fn driven() -> &'static StoreysRun {
    static RUN: OnceLock<StoreysRun> = OnceLock::new();
    RUN.get_or_init(|| Storeys::default().record(&Robot::default(), 1))
}

fn mapped() -> &'static Mapped {
    static MAPPED: OnceLock<Mapped> = OnceLock::new();
    MAPPED.get_or_init(|| map(SlamConfig::default(), &driven().run.observations))
}

/// The scan every patch was made of: stamps are unique.
fn scan_of(manifold: &manifold::Manifold, patch: PatchId) -> usize {
    static SCANS: OnceLock<BTreeMap<i64, usize>> = OnceLock::new();
    let scans = SCANS.get_or_init(|| {
        let observations = driven().run.observations.iter().enumerate();
        observations.map(|(scan, seen)| (seen.stamp.0, scan)).collect()
    });
    scans[&manifold.patch(patch).stamp.0]
}

#[test]
fn storeys_of_one_plan_are_two_levels() {
    let (driven, mapped) = (driven(), mapped());
    let manifold = &mapped.manifold;
    let islands = manifold.islands();
    assert_eq!(islands.len(), 1);
    let levels = manifold.levels(&islands[0]);
    assert_eq!(levels.heights_m.len(), 2, "{:?}", levels.heights_m);
    let between = levels.heights_m[1] - levels.heights_m[0];
    assert!((between - driven.storey_height_m).abs() < 0.1, "{between} m");
    let (mut all, mut right) = (0.0, 0.0);
    for member in &levels.members {
        let scan = scan_of(manifold, member.patch);
        all += 1.0;
        right += f64::from(u8::from(member.level == driven.storey(scan)));
        let height = manifold.patch(member.patch).elevation.expect("a height").height_m;
        let off = height - (driven.heights_m[scan] - driven.heights_m[0]);
        assert!(off.abs() < 0.2, "scan {scan} is {off} m too high");
    }
    assert!(right >= 0.99 * all, "{right} of {all} patches on the right level");
    let error = ate(&driven.run.truth, &mapped.trajectory);
    assert!(error <= 0.05, "{error} m");
}

/// A laser that tips where a ramp begins sees what lies at other heights: the robot is not lost.
#[test]
fn driving_onto_a_ramp_is_no_mishap() {
    let driven = Storeys { storeys: 3, ..Storeys::default() }.record(&Robot::default(), 16);
    let mut mapper = Mapper::new(SlamConfig::default());
    for observation in driven.run.observations.iter().take(1200) {
        mapper.step(observation.clone());
    }
    mapper.finish();
    assert_eq!(mapper.bad_stretches(), []);
}

#[test]
fn nothing_is_closed_between_storeys() {
    let manifold = &mapped().manifold;
    let height = |patch| driven().heights_m[scan_of(manifold, patch)];
    let mut closures = 0;
    for r in manifold.active_relations().filter(|r| r.provenance != Provenance::Sequential) {
        closures += 1;
        assert!((height(r.from) - height(r.to)).abs() < 1.0, "{} to {}", r.from.0, r.to.0);
    }
    assert!(closures > 0, "loops close on each storey");
}

/// The same drive without the inertial unit is one of flat ground: no heights, one level.
#[test]
fn without_attitude_there_is_one_level() {
    let blind = |seen: &Observation| Observation { attitude: None, ..seen.clone() };
    let observations: Vec<Observation> =
        driven().run.observations.iter().take(300).map(blind).collect();
    let mapped = map(SlamConfig::default(), &observations);
    let patches = mapped.manifold.patches();
    assert!(patches.iter().all(|patch| patch.elevation.is_none()));
    let levels = mapped.manifold.levels(&mapped.manifold.islands()[0]);
    assert_eq!(levels.heights_m, [0.0]);
}

/// Joins robots, each with an odometry frame of its own.
fn team(robots: &[&[Observation]]) -> Team {
    let mut team = Team::new(SlamConfig::default());
    for (number, observations) in robots.iter().enumerate() {
        let observations = observations.iter().cloned().map(|mut seen| {
            seen.odom_from_base = seen.odom_from_base.map(|pose| Pose2::new(5.0, -3.0, 1.0) * pose);
            seen
        });
        team.map_robot(&format!("robot-{number}"), observations);
    }
    team.finish();
    team
}

/// A robot that saw only one storey may be on either: it is not joined to one that saw both.
#[test]
fn storeys_that_look_alike_are_rivals() {
    let observations = &driven().run.observations;
    let upstairs: Vec<Observation> = (0..observations.len())
        .filter(|&scan| driven().storey(scan) == 1 && driven().on_floor(scan))
        .map(|scan| observations[scan].clone())
        .collect();
    let team = team(&[observations, &upstairs]);
    let manifold = team.manifold();
    let wrong = manifold.active_relations().filter(|r| {
        let ends = [r.from, r.to].map(|patch| manifold.patch(patch));
        let downstairs = |p: &Patch| driven().storey(scan_of(manifold, p.id)) == 0;
        ends[0].robot != ends[1].robot
            && ends.iter().any(|p| p.robot == RobotId(0) && downstairs(p))
    });
    assert_eq!(wrong.count(), 0, "{:?}", team.merges());
}

/// One robot went up and the other came down, which begins its map on the upper floor: storeys of
/// the same plan with furniture of their own are joined each to itself, and the second robot's
/// heights become those of the first one's island.
#[test]
fn robots_that_saw_both_storeys_are_joined_storey_by_storey() {
    let driven = Storeys { furnished_alike: false, ..Storeys::default() };
    let driven = driven.record(&Robot::default(), 1);
    let observations = &driven.run.observations;
    let (up, down) = (observations.len() * 7 / 10, observations.len() / 2);
    assert_eq!(driven.storey(down), 1);
    let team = team(&[&observations[..up], &observations[down..]]);
    let manifold = team.manifold();
    let islands = manifold.islands();
    assert_eq!(islands.len(), 1, "{:?}", team.merges());
    let levels = manifold.levels(&islands[0]);
    assert_eq!(levels.heights_m.len(), 2, "{:?}", levels.heights_m);
    let scan_of = |patch| scan_of(manifold, patch);
    for patch in manifold.patches() {
        let (found, truth) =
            (patch.elevation.unwrap().height_m, driven.heights_m[scan_of(patch.id)]);
        assert!((found - truth).abs() < 0.15, "patch {}: {found} m, {truth} m", patch.id.0);
    }
    let on_floor = levels.members.iter().filter(|m| driven.on_floor(scan_of(m.patch)));
    let (mut all, mut right) = (0.0, 0.0);
    for member in on_floor {
        all += 1.0;
        right += f64::from(u8::from(member.level == driven.storey(scan_of(member.patch))));
    }
    assert!(right >= 0.99 * all, "{right} of {all} patches on the right level");
    let height = |patch| driven.heights_m[scan_of(patch)];
    let across = manifold
        .active_relations()
        .filter(|r| r.provenance != Provenance::Sequential)
        .filter(|r| (height(r.from) - height(r.to)).abs() > 1.0);
    assert_eq!(across.count(), 0);
}

/// Of three storeys that are copies of each other to the furniture one robot saw the lower two and
/// another the upper two: that all of the one lies on all of the other explains as much as that
/// they share a storey, and is wrong. They are not joined.
#[test]
fn storeys_that_are_copies_are_joined_by_nothing() {
    let driven = Storeys { storeys: 3, ..Storeys::default() }.record(&Robot::default(), 1);
    let observations = &driven.run.observations;
    let storey = |scan: usize| driven.storey(scan);
    let first = |wanted: usize| (0..observations.len()).find(|&scan| storey(scan) == wanted);
    let (middle, top) = (first(1).unwrap(), first(2).unwrap());
    let last_on_top = (0..observations.len()).rfind(|&scan| storey(scan) == 2).unwrap();
    let on_floor = (middle..).find(|&scan| driven.on_floor(scan)).unwrap();
    let team = team(&[&observations[..top - 40], &observations[on_floor..last_on_top]]);
    assert_eq!(team.manifold().islands().len(), 2, "{:?}", team.merges());
}
