//! Local submaps against paths walked by hand.

use crate::graphs::gaussian;
use crate::graphs::{Link, build, limits, links, patch, tree};
use geometry::{GaussianPose2, Pose2};
use manifoldslam_manifold::SubmapLimits;
use proptest::prelude::*;

const PATCHES: usize = 9;

/// The relations from `start` to `end` in a tree, each as seen from its near end.
fn path(links: &[Link], start: usize, end: usize) -> Vec<GaussianPose2> {
    fn walk(links: &[Link], here: usize, end: usize, came: usize) -> Option<Vec<GaussianPose2>> {
        if here == end {
            return Some(Vec::new());
        }
        links.iter().find_map(|&(from, to, step)| {
            let (next, step) = match (from == here, to == here) {
                (true, _) => (to, step),
                (_, true) => (from, step.inverse()),
                _ => return None,
            };
            if next == came {
                return None;
            }
            let mut rest = walk(links, next, end, here)?;
            rest.insert(0, step);
            Some(rest)
        })
    }
    walk(links, start, end, usize::MAX).expect("a tree is connected")
}

/// The composed Gaussians along a path, one per step.
fn composed(path: &[GaussianPose2]) -> Vec<GaussianPose2> {
    let mut sum = GaussianPose2::exact(Pose2::IDENTITY);
    path.iter()
        .map(|step| {
            sum = sum.compose(step);
            sum
        })
        .collect()
}

proptest! {
    /// In a tree there is one way to each patch: it is a member if and only if every pose on the
    /// way is within the limits.
    #[test]
    fn in_a_tree_members_are_the_patches_known_well_enough(
        links in tree(PATCHES),
        limits in limits(),
        start in 0..PATCHES,
    ) {
        let limits = SubmapLimits { patches: PATCHES, ..limits };
        let members = build(PATCHES, &links).local_submap(patch(start), &limits);
        for end in 0..PATCHES {
            let way = composed(&path(&links, start, end));
            let expected = way.iter().all(|pose| {
                let interval = |i: usize| 1.96 * pose.covariance[(i, i)].sqrt();
                pose.mean.norm() <= limits.distance_m
                    && interval(0).max(interval(1)) <= limits.translation_m
                    && interval(2) <= limits.rotation_rad
            });
            let member = members.iter().find(|m| m.patch == patch(end));
            prop_assert_eq!(member.is_some(), expected, "patch {} from {}", end, start);
            if let (Some(member), Some(last)) = (member, way.last()) {
                prop_assert_eq!(&member.start_from_patch, last);
                prop_assert_eq!(member.steps, way.len());
            }
        }
    }

    /// In any graph: the start first; then each member admitted, composed onto a member one step
    /// nearer; never one twice; nothing left out that a member could reach.
    #[test]
    fn in_a_graph_the_submap_is_a_complete_search_in_breadth(
        links in links(PATCHES, 16, gaussian()),
        limits in limits(),
        start in 0..PATCHES,
    ) {
        let manifold = build(PATCHES, &links);
        let members = manifold.local_submap(patch(start), &limits);
        prop_assert!(members[0].patch == patch(start) && members[0].steps == 0);
        prop_assert!(members.len() <= limits.patches);
        prop_assert!(members.is_sorted_by_key(|m| m.steps));
        for (i, member) in members.iter().enumerate().skip(1) {
            prop_assert!(limits.admit(&member.start_from_patch));
            prop_assert!(members[..i].iter().all(|m| m.patch != member.patch));
            let reached = members[..i].iter().any(|near| {
                near.steps + 1 == member.steps
                    && manifold.neighbours(near.patch).any(|(other, step)| {
                        other == member.patch
                            && near.start_from_patch.compose(&step) == member.start_from_patch
                    })
            });
            prop_assert!(reached, "{:?}", member);
        }
        if members.len() < limits.patches {
            for near in &members {
                for (other, step) in manifold.neighbours(near.patch) {
                    let inside = members.iter().any(|m| m.patch == other);
                    prop_assert!(inside || !limits.admit(&near.start_from_patch.compose(&step)));
                }
            }
        }
    }

    /// A smaller number of patches keeps the first of them.
    #[test]
    fn a_limit_on_patches_cuts_the_end_off(
        links in links(PATCHES, 16, gaussian()),
        limits in limits(),
    ) {
        let manifold = build(PATCHES, &links);
        let all = manifold.local_submap(patch(0), &SubmapLimits { patches: 100, ..limits });
        let cut = manifold.local_submap(patch(0), &limits);
        prop_assert_eq!(&cut[..], &all[..limits.patches.min(all.len())]);
    }
}
