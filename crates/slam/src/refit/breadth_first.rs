use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use geometry::Pose2;
use manifold::{PatchId, Provenance};
use matching::{FastMatcher, Prior, SurfelField};
use std::collections::VecDeque;

/// The thesis's refit (algorithm 5.4): outwards from the patches that closed loops, every patch is
/// matched anew with the neighbour it is reached from and placed there.
///
/// The error is pushed to the far side of each loop, over half its length; kept for comparison with
/// the global refit. Without closures nothing changes.
pub(crate) fn refit_breadth_first(map: &mut Map, config: &SlamConfig) {
    let matcher = FastMatcher { settings: config.matcher };
    let mut placed: Vec<Option<Pose2>> = vec![None; map.manifold.patches().len()];
    let mut frontier = VecDeque::new();
    let closures: Vec<_> = map
        .manifold
        .active_relations()
        .filter(|r| r.provenance != Provenance::Sequential)
        .copied()
        .collect();
    for closure in &closures {
        for patch in [closure.from, closure.to] {
            if frontier.is_empty() {
                placed[patch.index()] = Some(map.pose(patch));
                frontier.push_back(patch);
            }
        }
    }
    let mut field = SurfelField::new(config.field, (0.0, 0.0), (0.0, 0.0));
    while let Some(patch) = frontier.pop_front() {
        let Some(pose) = placed[patch.index()] else { continue };
        lay_field(&mut field, map, &[(patch, Pose2::IDENTITY)], f64::from(config.field.reach_m));
        for (next, believed) in map.manifold.neighbours(patch).collect::<Vec<_>>() {
            if placed[next.index()].is_some() {
                continue;
            }
            let information = believed.covariance.try_inverse().unwrap_or_default();
            let prior = Prior { pose: believed.mean, information };
            let result = matcher.align(&field, map.surface(next), &prior);
            let fits = result.status.is_usable()
                && result.inlier_ratio > config.refit.overlap_share
                && result.pose.distance(&believed.mean) < 0.3;
            let step = if fits { result.pose } else { believed.mean };
            placed[next.index()] = Some(pose * step);
            frontier.push_back(next);
        }
    }
    let poses = placed
        .into_iter()
        .enumerate()
        .filter_map(|(index, pose)| Some((PatchId(index as u32), pose?)))
        .collect();
    map.manifold.refit(poses);
}
