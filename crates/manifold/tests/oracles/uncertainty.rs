//! Uncertainty along paths: against numeric derivatives, direct composition and Bellman and Ford.

use crate::graphs::{build, gaussian, gaussian_without_yaw_noise, known_from, links, patch, tree};
use geometry::{GaussianPose2, LieGroup, Matrix3, Pose2, Vector3};
use manifoldslam_manifold::KeyPatches;
use proptest::prelude::*;

const PATCHES: usize = 8;

/// Covariance at the end of a chain: each step's error carried there by numeric derivatives.
fn numeric_covariance(chain: &[GaussianPose2]) -> Matrix3<f64> {
    let end = |index: usize, error: Vector3<f64>| {
        chain.iter().enumerate().fold(Pose2::IDENTITY, |pose, (i, step)| {
            let moved = pose * step.mean;
            if i == index { moved.retract(&error) } else { moved }
        })
    };
    let truth = end(usize::MAX, Vector3::zeros());
    (0..chain.len()).fold(Matrix3::zeros(), |sum, index| {
        let h = 1e-5;
        let columns: Vec<Vector3<f64>> = (0..3)
            .map(|axis| {
                let mut error = Vector3::zeros();
                error[axis] = h;
                let ahead = truth.between(&end(index, error)).log();
                let behind = truth.between(&end(index, -error)).log();
                (ahead - behind) / (2.0 * h)
            })
            .collect();
        let jacobian = Matrix3::from_columns(&columns);
        sum + jacobian * chain[index].covariance * jacobian.transpose()
    })
}

proptest! {
    #[test]
    fn along_a_chain_errors_add_up_at_its_end(
        chain in prop::collection::vec(gaussian(), 1..PATCHES),
    ) {
        let links: Vec<_> = chain.iter().enumerate().map(|(i, &g)| (i, i + 1, g)).collect();
        let known = known_from(&build(chain.len() + 1, &links), patch(0));
        let end = known.last().copied().flatten().expect("a chain is connected");
        let expected = numeric_covariance(&chain);
        prop_assert!((end.covariance - expected).norm() < 1e-6 * (1.0 + expected.norm()));
    }

    /// In the chain's first frame nothing that was lost on the way comes back: the determinant of
    /// the covariance (the adjoint's is one) and the yaw's variance only grow.
    #[test]
    fn along_a_chain_uncertainty_grows(chain in prop::collection::vec(gaussian(), 2..PATCHES)) {
        let links: Vec<_> = chain.iter().enumerate().map(|(i, &g)| (i, i + 1, g)).collect();
        let known = known_from(&build(chain.len() + 1, &links), patch(0));
        let known: Vec<_> = known.into_iter().flatten().map(|g| g.covariance).collect();
        for pair in known.windows(2) {
            prop_assert!(pair[1].determinant() >= pair[0].determinant());
            prop_assert!(pair[1][(2, 2)] > pair[0][(2, 2)]);
        }
    }

    /// Without yaw noise the variance of a path is the sum of its relations', so the least one is
    /// what Bellman and Ford find.
    #[test]
    fn position_variances_are_shortest_paths(
        links in links(PATCHES, 14, gaussian_without_yaw_noise()),
    ) {
        let variance = |g: &GaussianPose2| g.covariance[(0, 0)] + g.covariance[(1, 1)];
        let mut least = [f64::INFINITY; PATCHES];
        least[0] = 0.0;
        for _ in 0..PATCHES {
            for (from, to, step) in &links {
                least[*to] = least[*to].min(least[*from] + variance(step));
                least[*from] = least[*from].min(least[*to] + variance(step));
            }
        }
        let known = known_from(&build(PATCHES, &links), patch(0));
        for (found, &expected) in known.iter().zip(&least) {
            prop_assert_eq!(found.is_some(), expected.is_finite());
            if let Some(found) = found {
                prop_assert!((variance(found) - expected).abs() < 1e-12);
            }
        }
    }

    /// Asking for some patches gives for them what asking for all gives.
    #[test]
    fn a_search_for_some_patches_finds_those(
        links in links(PATCHES, 14, gaussian()),
        wanted in prop::collection::vec(0..PATCHES, 0..4),
    ) {
        let manifold = build(PATCHES, &links);
        let all = known_from(&manifold, patch(0));
        let wanted: Vec<_> = wanted.into_iter().map(patch).collect();
        let some = manifold.uncertainty_from(patch(0), &wanted);
        for id in wanted {
            prop_assert_eq!(some[id.index()], all[id.index()]);
        }
    }

    /// What is known well is known as if all were asked for.
    #[test]
    fn a_search_that_stops_finds_what_is_known_well(
        links in links(PATCHES, 14, gaussian()),
        most_std_m in 0.0..3.0f64,
    ) {
        let manifold = build(PATCHES, &links);
        let all = known_from(&manifold, patch(0));
        let within = manifold.uncertainty_within(patch(0), most_std_m);
        for (id, known) in &within {
            prop_assert_eq!(Some(*known), all[id.index()]);
        }
        for (index, known) in all.iter().enumerate() {
            let variance = known.map(|g| g.covariance[(0, 0)] + g.covariance[(1, 1)]);
            if variance.is_none_or(|v| v > most_std_m * most_std_m) {
                prop_assert!(index == 0 || !within.contains_key(&patch(index)));
            }
        }
    }

    /// Every patch has its key patch, key patches hang together as the islands do, and by way of
    /// them nothing is known better than it is: without yaw noise the variances of a path add up.
    #[test]
    fn by_way_of_key_patches_nothing_is_known_better(
        links in links(PATCHES, 14, gaussian_without_yaw_noise()),
        std_m in 0.0..1.0f64,
    ) {
        let variance = |g: &GaussianPose2| g.covariance[(0, 0)] + g.covariance[(1, 1)];
        let manifold = build(PATCHES, &links);
        let keys = KeyPatches::new(&manifold, std_m);
        let mut members: Vec<_> = (0..keys.count()).flat_map(|key| keys.members(key)).collect();
        members.sort_unstable();
        prop_assert!(members.into_iter().copied().eq((0..PATCHES).map(patch)));
        for a in (0..PATCHES).map(patch) {
            let best = known_from(&manifold, a);
            let (key, key_from_a) = keys.of(a).expect("every patch has one");
            prop_assert!(variance(&key_from_a) <= std_m * std_m + 1e-12);
            let known = keys.known_from(key);
            for b in (0..PATCHES).map(patch) {
                let (other, other_from_b) = keys.of(b).expect("every patch has one");
                prop_assert_eq!(known.contains_key(&other), best[b.index()].is_some());
                if let (Some(step), Some(best)) = (known.get(&other), &best[b.index()]) {
                    let by_keys = key_from_a.inverse().compose(step).compose(&other_from_b);
                    prop_assert!(variance(&by_keys) >= variance(best) - 1e-9);
                }
            }
        }
    }

    /// In a tree there is nothing to choose: what is known is what the submap composes.
    #[test]
    fn in_a_tree_it_is_the_composition(links in tree(PATCHES), start in 0..PATCHES) {
        let manifold = build(PATCHES, &links);
        let limits = manifoldslam_manifold::SubmapLimits {
            translation_m: f64::INFINITY,
            rotation_rad: f64::INFINITY,
            distance_m: f64::INFINITY,
            patches: PATCHES,
        };
        let known = known_from(&manifold, patch(start));
        for member in manifold.local_submap(patch(start), &limits) {
            prop_assert_eq!(known[member.patch.index()], Some(member.start_from_patch));
        }
    }
}
