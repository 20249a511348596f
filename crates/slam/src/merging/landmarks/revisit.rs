use super::comparison::compare_landmarks;
use super::consensus::GATE_CHI2;
use super::links::link;
use super::places::{area_of, places_among, with_drift};
use crate::SlamConfig;
use crate::map::Map;
use crate::merging::Link;
use geometry::GaussianPose2;
use manifold::{PatchId, PatchSighting};

/// Links from where landmarks were seen before to where the robot sees them again, on one island:
/// the part just driven is laid onto the older one as one island onto another.
///
/// At least two landmarks must agree, and what they say must be possible by the way between.
pub(crate) fn revisit(
    map: &Map,
    old: &[&PatchSighting],
    recent: &[&PatchSighting],
    config: &SlamConfig,
) -> Vec<Link> {
    let known = |seen: &[&PatchSighting]| {
        let landmarks = places_among(&map.manifold, seen);
        let patches: Vec<PatchId> = seen.iter().map(|s| s.patch).collect();
        let area_m2 = area_of(&map.manifold, &landmarks, &patches);
        with_drift(&map.manifold, landmarks, area_m2)
    };
    let (target, source) = (known(old), known(recent));
    let settings = &config.merging.landmarks;
    let found = compare_landmarks(&target, &source, settings);
    let Some(found) =
        found.filter(|f| f.pairs.len() >= 2 && f.false_bound <= settings.false_merges)
    else {
        return Vec::new();
    };
    let pairs: Vec<_> =
        found.pairs.iter().map(|&(t, s)| (&target.landmarks[t], &source.landmarks[s])).collect();
    let linked = link(map, &pairs, &found.target_from_source, config);
    let refuted = linked.contradicting > 0 && linked.contradicting + 2 >= pairs.len();
    let possible = linked.links.iter().all(|link| is_possible(map, link));
    if refuted || !possible { Vec::new() } else { linked.links }
}

/// True when a link is where the way between its patches leads, within its uncertainty.
fn is_possible(map: &Map, link: &Link) -> bool {
    let known = map.manifold.uncertainty_from(link.from, &[link.to]);
    let Some(way) = known[link.to.index()] else { return false };
    let covariance = way.covariance + link.from_from_to.covariance;
    let mean = map.pose(link.from).between(&map.pose(link.to));
    let predicted = GaussianPose2 { mean, covariance };
    let surprise = predicted.mahalanobis_squared(&link.from_from_to.mean);
    surprise.is_some_and(|chi2| chi2 <= GATE_CHI2[2])
}
