//! Relations: walking through them, and what they connect.

use crate::graphs::{add_patch, build, gaussian, links, patch, pose};
use geometry::{GaussianPose2, LieGroup, Pose2};
use manifoldslam_manifold::{Manifold, Provenance, Relation, through_relation};
use proptest::prelude::*;

fn near(a: &Pose2, b: &Pose2) -> bool {
    a.between(b).log().norm() < 1e-9
}

/// Two patches and a relation of the given covariance that agrees with their poses.
fn consistent(a: Pose2, b: Pose2, noise: &GaussianPose2) -> (Manifold, Relation) {
    let mut manifold = Manifold::new();
    let (from, to) = (add_patch(&mut manifold, a), add_patch(&mut manifold, b));
    let step = GaussianPose2 { mean: a.between(&b), covariance: noise.covariance };
    let id = manifold.relate(from, to, step, Provenance::LoopClosure);
    let relation = *manifold.relation(id);
    (manifold, relation)
}

proptest! {
    #[test]
    fn through_an_exact_relation_is_by_way_of_the_island(
        a in pose(), b in pose(), robot in gaussian(), noise in gaussian(),
    ) {
        let (manifold, mut relation) = consistent(a, b, &noise);
        let (from, to) = (relation.from, relation.to);
        let pose = |p| manifold.patch(p).island_from_patch;
        for (here, there) in [(from, to), (to, from)] {
            let (other, seen) = through_relation(&robot, here, &relation).expect("an end");
            prop_assert_eq!(other, there);
            let expected = pose(there).between(&(pose(here) * robot.mean));
            prop_assert!(near(&seen.mean, &expected));
            let carried = relation.carry(here, &robot.mean).expect("an end");
            prop_assert!(carried.0 == there && near(&carried.1, &expected));
            // The relation's doubt is added: the difference is positive semi-definite.
            let gain = seen.covariance - robot.covariance;
            prop_assert!(gain.symmetric_eigenvalues().min() > -1e-12);
            prop_assert!(gain.trace() > 0.0);
        }
        relation.from_from_to.covariance.fill(0.0);
        let (_, seen) = through_relation(&robot, from, &relation).expect("an end");
        prop_assert!((seen.covariance - robot.covariance).norm() < 1e-12);
    }

    #[test]
    fn through_a_relation_is_through_its_inverse(robot in gaussian(), step in gaussian()) {
        let (_, forward) = consistent(Pose2::IDENTITY, step.mean, &step);
        let backward = Relation {
            from: forward.to,
            to: forward.from,
            from_from_to: forward.from_from_to.inverse(),
            ..forward
        };
        for end in [forward.from, forward.to] {
            let (a, seen_a) = through_relation(&robot, end, &forward).expect("an end");
            let (b, seen_b) = through_relation(&robot, end, &backward).expect("an end");
            prop_assert_eq!(a, b);
            prop_assert!(near(&seen_a.mean, &seen_b.mean));
            prop_assert!((seen_a.covariance - seen_b.covariance).norm() < 1e-9);
            let (back, seen) = through_relation(&seen_a, a, &forward).expect("an end");
            prop_assert!(back == end && near(&seen.mean, &robot.mean));
        }
        prop_assert!(through_relation(&robot, patch(2), &forward).is_none());
        prop_assert!(forward.carry(patch(2), &robot.mean).is_none());
    }

    #[test]
    fn islands_are_what_union_find_says(links in links(12, 14, gaussian())) {
        let mut root: Vec<usize> = (0..12).collect();
        for &(a, b, _) in &links {
            let (a, b) = (root[a], root[b]);
            for r in &mut root {
                if *r == a.max(b) {
                    *r = a.min(b);
                }
            }
        }
        let mut expected: Vec<Vec<_>> = Vec::new();
        for r in 0..12 {
            let island: Vec<_> = (0..12).filter(|&i| root[i] == r).map(patch).collect();
            if !island.is_empty() {
                expected.push(island);
            }
        }
        prop_assert_eq!(build(12, &links).islands(), expected);
    }
}
