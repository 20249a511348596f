use super::recognition::PlaceMatch;
use crate::map::Map;
use geometry::{GaussianPose2, Matrix3, Vector3};
use manifold::PatchId;
use optimizer::{ClosureCandidate, ConsistencySettings, consistent_sets};

/// Two matches next to each other may disagree by so much: metres, metres, radians.
const TOLERANCE: [f64; 3] = [0.2, 0.2, 0.05];
/// What an island may be bent, per metre between two of its places: metres, radians.
const BENT_PER_M: [f64; 3] = [0.02, 0.02, 0.002];
/// Farther apart they are bent no more than at this distance, metres: beyond it an alignment that
/// differs by what would be allowed is another one, and matches all over a campus would agree with
/// each other whatever they say.
const BENT_UP_TO_M: f64 = 50.0;
/// Sets of matches are looked for among the best so many of a pair of islands.
const MOST_MATCHES: usize = 600;

/// Sets of matches between two islands that agree pairwise about how the islands lie to each other,
/// the largest first: pairwise consistency maximisation (Mangelson et al. 2018) with tolerances for
/// how far islands are bent in place of covariances, which know nothing of closures.
pub(super) fn agreeing_sets(
    map: &Map,
    matches: &[PlaceMatch],
    least: usize,
) -> Vec<Vec<PlaceMatch>> {
    let mut best = matches.to_vec();
    best.sort_by(|a, b| {
        b.share.total_cmp(&a.share).then_with(|| (a.from, a.to).cmp(&(b.from, b.to)))
    });
    best.truncate(MOST_MATCHES);
    let settings = ConsistencySettings::new(3);
    let tolerance = |values: [f64; 3]| {
        Matrix3::from_diagonal(&Vector3::from(values).map(|v| v * v / settings.max_chi2))
    };
    let candidates: Vec<ClosureCandidate<_, 3>> = best
        .iter()
        .map(|m| ClosureCandidate {
            from: m.from.0.into(),
            to: m.to.0.into(),
            // Half of it each: the two of a pair add up.
            measured: GaussianPose2 {
                mean: m.from_from_to.mean,
                covariance: tolerance(TOLERANCE) * 0.5,
            },
        })
        .collect();
    let within = |a: u64, b: u64| {
        let (a, b) = (PatchId(a as u32), PatchId(b as u32));
        let mean = map.pose(a).between(&map.pose(b));
        let bent = BENT_PER_M.map(|per_m| per_m * mean.norm().min(BENT_UP_TO_M));
        Some(GaussianPose2 { mean, covariance: tolerance(bent) })
    };
    consistent_sets(&candidates, within, &settings, least)
        .into_iter()
        .take(MOST_SETS)
        .map(|set| set.members.into_iter().map(|i| best[i]).collect())
        .collect()
}

/// The best set and its rivals.
const MOST_SETS: usize = 3;
