//! The journal: replayed it rebuilds the map; what does not follow is refused.

use crate::graphs::{add_patch, assert_same_map, build, gaussian, patch, pose};
use geometry::{GaussianPose2, Pose2};
use manifoldslam_manifold::{
    Change, Manifold, ManifoldError, PatchId, Provenance, RelationId, Retraction, SubmapLimits,
};
use proptest::prelude::*;

/// Something done to a manifold; indices are taken modulo what is there.
#[derive(Clone, Debug)]
enum Deed {
    Add(Pose2),
    Relate(usize, usize, GaussianPose2),
    Retract(usize),
    Propose(usize, usize, GaussianPose2),
    Confirm(usize),
    LeaveOut(usize, bool),
    Refit(Vec<(usize, Pose2)>),
}

fn deed() -> impl Strategy<Value = Deed> {
    let some = 0..1000usize;
    prop_oneof![
        pose().prop_map(Deed::Add),
        (some.clone(), some.clone(), gaussian()).prop_map(|(a, b, g)| Deed::Relate(a, b, g)),
        some.clone().prop_map(Deed::Retract),
        (some.clone(), some.clone(), gaussian()).prop_map(|(a, b, g)| Deed::Propose(a, b, g)),
        some.clone().prop_map(Deed::Confirm),
        (some.clone(), any::<bool>()).prop_map(|(p, out)| Deed::LeaveOut(p, out)),
        prop::collection::vec((some, pose()), 0..4).prop_map(Deed::Refit),
    ]
}

fn perform(manifold: &mut Manifold, deed: &Deed) {
    let (patches, relations) = (manifold.patches().len(), manifold.relations().len());
    match deed {
        Deed::Add(pose) => {
            add_patch(manifold, *pose);
        }
        Deed::Relate(a, b, step) if patches > 1 => {
            let (a, b) = (a % patches, b % (patches - 1));
            let (from, to) = (patch(a), patch((a + 1 + b) % patches));
            manifold.relate(from, to, *step, Provenance::LoopClosure);
        }
        Deed::Propose(a, b, step) if patches > 1 => {
            let (a, b) = (a % patches, b % (patches - 1));
            let (from, to) = (patch(a), patch((a + 1 + b) % patches));
            manifold.propose(from, to, *step, Provenance::Merge);
        }
        Deed::Confirm(id) if relations > 0 => {
            manifold.confirm(RelationId((id % relations) as u32));
        }
        Deed::LeaveOut(p, out) if patches > 0 => manifold.leave_out(vec![patch(p % patches)], *out),
        Deed::Retract(id) if relations > 0 => {
            manifold.retract(RelationId((id % relations) as u32), Retraction::Contradicted);
        }
        Deed::Refit(poses) if patches > 0 => {
            manifold.refit(poses.iter().map(|(p, pose)| (patch(p % patches), *pose)).collect());
        }
        _ => {}
    }
}

proptest! {
    #[test]
    fn replaying_the_journal_rebuilds_the_map(
        deeds in prop::collection::vec(deed(), 0..40),
        taken_after in 0..40usize,
    ) {
        let mut manifold = Manifold::new();
        let mut journal = Vec::new();
        for (i, deed) in deeds.iter().enumerate() {
            perform(&mut manifold, deed);
            if i == taken_after {
                journal.extend(manifold.take_journal());
            }
        }
        journal.extend(manifold.take_journal());
        let mut replica = Manifold::new();
        for change in &journal {
            prop_assert_eq!(replica.apply(change), Ok(()));
        }
        prop_assert_eq!(manifold.relations(), replica.relations());
        assert_same_map(&manifold, &replica, &SubmapLimits::default());
        prop_assert_eq!(replica.take_journal(), journal, "a replica can be replayed in turn");
        prop_assert!(manifold.take_journal().is_empty());
    }
}

#[test]
fn changes_out_of_order_are_refused_and_change_nothing() {
    let step = GaussianPose2::exact(Pose2::new(1.0, 0.0, 0.0));
    let mut longer = build(3, &[(0, 1, step), (1, 2, step)]);
    let journal = longer.take_journal();
    let [_, _, third_patch, first_relation, second_relation] = &journal[..] else {
        panic!("{journal:?}");
    };
    let unknown = PatchId(2);
    let moved = vec![(PatchId(0), Pose2::new(9.0, 9.0, 1.0)), (unknown, Pose2::IDENTITY)];
    let fresh = build(2, &[]);
    for change in [
        &journal[0],
        &journal[1],
        second_relation,
        &Change::RelationRetracted(RelationId(0), Retraction::ByUser),
        &Change::RelationConfirmed(RelationId(0)),
        &Change::LeftOut(vec![unknown], true),
        &Change::PosesReestimated(moved),
    ] {
        let mut manifold = fresh.clone();
        assert_eq!(manifold.apply(change), Err(ManifoldError::OutOfOrder), "{change:?}");
        assert_same_map(&manifold, &fresh, &SubmapLimits::default());
        assert_eq!(manifold.take_journal(), fresh.clone().take_journal());
    }
    let mut manifold = fresh;
    let Change::RelationAdded(relation) = second_relation else { panic!("{second_relation:?}") };
    let dangling =
        Change::RelationAdded(manifoldslam_manifold::Relation { id: RelationId(0), ..*relation });
    assert_eq!(manifold.apply(&dangling), Err(ManifoldError::OutOfOrder));
    for change in [first_relation, third_patch, second_relation] {
        assert_eq!(manifold.apply(change), Ok(()));
    }
    assert_eq!(manifold.apply(second_relation), Err(ManifoldError::OutOfOrder), "twice");
}
