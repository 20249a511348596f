//! False relations that were believed early are taken back once true ones contradict them; the map
//! then equals the one built without them.

use super::Team;
use crate::SlamConfig;
use geometry::{GaussianPose2, LieGroup, Matrix3, Pose2, Vector3};
use manifold::{PatchId, Provenance, RelationId, RelationState, Retraction};
use sensing::RobotId;
use synthetic::{Run, two_loop_building};

/// Robots map parts of one log by themselves; nothing joins them yet.
fn strangers(run: &Run, parts: &[(usize, usize)]) -> Team {
    let mut config = SlamConfig::default();
    config.merging.enabled = false;
    let mut team = Team::new(config);
    for (number, &(from, to)) in parts.iter().enumerate() {
        let part = &run.observations[from..to.min(run.observations.len())];
        team.map_robot(&format!("robot-{number}"), part.iter().cloned());
    }
    // Loops that are searched for on the ground of a false merge may support it, where the building
    // looks alike: only what is related here is to speak.
    team.config.closing.enabled = false;
    team
}

/// The true pose of one patch seen from another, as a match knows it, moved by `error`.
fn measured(team: &Team, run: &Run, from: PatchId, to: PatchId, error: Pose2) -> GaussianPose2 {
    let truth = |patch: PatchId| {
        let stamp = team.map.manifold.patch(patch).stamp;
        let scan = run.observations.iter().position(|o| o.stamp == stamp);
        run.truth[scan.expect("a patch of this run")]
    };
    let std = Vector3::new(0.03, 0.03, 0.01);
    let covariance = Matrix3::from_diagonal(&std.component_mul(&std));
    let mean = truth(from).between(&truth(to)) * error;
    GaussianPose2 { mean, covariance }
}

fn relate(
    team: &mut Team,
    run: &Run,
    (from, to): (PatchId, PatchId),
    provenance: Provenance,
    error: Pose2,
) -> RelationId {
    let relation = measured(team, run, from, to, error);
    team.map.manifold.relate(from, to, relation, provenance)
}

fn state(team: &Team, id: RelationId) -> RelationState {
    team.map.manifold.relation(id).state
}

/// The map equals that of a team that never had the relation.
fn assert_as_if_it_had_never_been(team: &Team, id: RelationId) {
    let mut without = team.with_relations(|r| r.is_active() && r.id != id);
    without.finish();
    for (a, b) in team.manifold().patches().iter().zip(without.manifold().patches()) {
        let off = a.island_from_patch.between(&b.island_from_patch).log().norm();
        assert!(off < 1e-6, "{off}");
    }
    let robots = 0..team.manifold().robots().len() as u16;
    for robot in robots.map(RobotId) {
        for (a, b) in team.trajectory(robot).iter().zip(without.trajectory(robot)) {
            assert!(a.between(&b).log().norm() < 1e-6);
        }
    }
}

const CONTRADICTED: RelationState = RelationState::Retracted(Retraction::Contradicted);

/// Two robots in one building: patches of the one and of the other spread over what both saw.
fn pairs(team: &Team, count: usize) -> Vec<(PatchId, PatchId)> {
    let of = |robot| {
        let patches = team.manifold().patches().iter().filter(move |p| p.robot == RobotId(robot));
        patches.map(|p| p.id).collect::<Vec<_>>()
    };
    let (first, second) = (of(0), of(1));
    let spread = |list: &[PatchId], k: usize| list[(2 * k + 1) * list.len() / (2 * count)];
    (0..count).map(|k| (spread(&first, k), spread(&second, k))).collect()
}

#[test]
fn a_false_merge_is_taken_back_when_true_ones_contradict_it() {
    let run = two_loop_building(5);
    for error in [Pose2::new(3.0, -1.0, 0.0), Pose2::new(0.0, 0.0, 1.6), Pose2::new(8.0, 9.0, 3.0)]
    {
        let mut team = strangers(&run, &[(0, 400), (280, usize::MAX)]);
        let pairs = pairs(&team, 4);
        let wrong = relate(&mut team, &run, pairs[0], Provenance::Merge, error);
        team.finish();
        assert_eq!(state(&team, wrong), RelationState::Active, "nothing speaks against it yet");
        assert_eq!(team.manifold().islands().len(), 1);
        let mut right = Vec::new();
        for &pair in &pairs[1..] {
            right.push(relate(&mut team, &run, pair, Provenance::Merge, Pose2::IDENTITY));
        }
        team.finish();
        assert_eq!(state(&team, wrong), CONTRADICTED, "{error:?}");
        assert!(right.iter().all(|&id| state(&team, id) == RelationState::Active), "{error:?}");
        assert_as_if_it_had_never_been(&team, wrong);
    }
}

#[test]
fn a_false_closure_is_taken_back_when_the_robot_s_own_closures_contradict_it() {
    let run = two_loop_building(6);
    for (seed, error) in [Pose2::new(2.0, 1.0, 0.1), Pose2::new(-1.0, 4.0, -0.7)].iter().enumerate()
    {
        let mut team = strangers(&run, &[(0, usize::MAX)]);
        let patches = team.manifold().patches().len() as u32;
        let ends = (PatchId(10 + seed as u32), PatchId(patches / 2));
        let wrong = relate(&mut team, &run, ends, Provenance::LoopClosure, *error);
        team.finish();
        assert_eq!(state(&team, wrong), CONTRADICTED);
        let others = team.manifold().relations().iter().filter(|r| r.id != wrong);
        let lost = others.filter(|r| r.state == CONTRADICTED).count();
        assert_eq!(lost, 0, "true closures stay");
        assert_as_if_it_had_never_been(&team, wrong);
    }
}
