//! Joining islands by landmarks that were seen from both, and by robots that saw each other.
//!
//! Algorithm 5.5 of the thesis with the errata's fixes: where landmarks lie on each island
//! (`places`, `rendezvous`), which of them agree (`consensus`, `alignment`), how sure that is
//! (`bound`), and the relations they make (`links`, `single`). See docs/math/landmarks.md.

mod alignment;
mod bound;
mod comparison;
mod consensus;
mod island;
mod links;
mod misread;
mod places;
mod rendezvous;
mod revisit;
mod settings;
mod single;

pub(crate) use alignment::point_jacobian;
pub use comparison::{LandmarkAlignment, compare_landmarks};
pub(crate) use consensus::GATE_CHI2;
pub(crate) use island::turned;
pub use island::{IslandLandmark, IslandLandmarks};
pub(crate) use places::places_of;
pub(crate) use revisit::revisit;
pub use settings::{LandmarkRefit, LandmarkSettings};

use super::{EvidenceCounts, Proposal};
use crate::SlamConfig;
use crate::map::Map;
use crate::track::ScanRecord;
use geometry::Pose2;
use links::link;
use manifold::Islands;
use places::{area_of, with_drift};
use rayon::prelude::*;
use rendezvous::meetings;
use single::one_and_a_match;

/// Scans that match at the landmarks leave a wrong alignment so much less likely: one look-alike in
/// ten alignments.
const ALIKE: f64 = 0.1;

/// For each two islands, of which one at least is new, how they lie to each other by the landmarks
/// that both know, in the order of the islands. `tracks` are the robots' scans, in the order of the
/// robots.
pub(crate) fn propose_by_landmarks(
    map: &Map,
    islands: &Islands,
    tracks: &[&[ScanRecord]],
    is_new: impl Fn(usize) -> bool,
    config: &SlamConfig,
) -> Vec<Proposal> {
    let settings = &config.merging.landmarks;
    if !settings.enabled || map.manifold.sightings().is_empty() {
        return Vec::new();
    }
    let known = landmarks_of(map, islands, tracks, config);
    let pairs = (0..known.len()).flat_map(|t| (t + 1..known.len()).map(move |s| (t, s)));
    let pairs: Vec<(usize, usize)> = pairs.filter(|&(t, s)| is_new(t) || is_new(s)).collect();
    pairs
        .par_iter()
        .filter_map(|&(target, source)| propose(map, &known[target], &known[source], config))
        .collect()
}

/// What each island knows of landmarks.
fn landmarks_of(
    map: &Map,
    islands: &Islands,
    tracks: &[&[ScanRecord]],
    config: &SlamConfig,
) -> Vec<IslandLandmarks> {
    let mut places = places_of(&map.manifold, islands);
    if config.merging.landmarks.common_clock {
        for (island, landmark) in meetings(&map.manifold, islands, tracks) {
            places[island].push(landmark);
        }
    }
    let with_members = places.into_par_iter().zip(&islands.members);
    with_members
        .map(|(landmarks, patches)| {
            let area_m2 = area_of(&map.manifold, &landmarks, patches);
            with_drift(&map.manifold, landmarks, area_m2)
        })
        .collect()
}

fn propose(
    map: &Map,
    target: &IslandLandmarks,
    source: &IslandLandmarks,
    config: &SlamConfig,
) -> Option<Proposal> {
    if target.landmarks.is_empty() || source.landmarks.is_empty() {
        return None;
    }
    let Some(found) = compare_landmarks(target, source, &config.merging.landmarks) else {
        return one_and_a_match(map, target, source, config);
    };
    let pairs: Vec<_> =
        found.pairs.iter().map(|&(t, s)| (&target.landmarks[t], &source.landmarks[s])).collect();
    let linked = link(map, &pairs, &found.target_from_source, config);
    Some(Proposal {
        target_from_source: found.target_from_source.mean,
        evidence: EvidenceCounts {
            matches: linked.matched,
            agreeing: pairs.len(),
            contradicting: linked.contradicting + found.refused,
            ..EvidenceCounts::default()
        },
        false_bound: weighed(found.false_bound, &linked, pairs.len()),
        most_false: config.merging.landmarks.false_merges,
        links: linked.links,
    })
}

/// The bound after the scans were heard: walls that one island sees through speak against an
/// alignment unless as many landmarks as all but one of it match.
fn weighed(false_bound: f64, linked: &links::Linked, landmarks: usize) -> f64 {
    let refuted = linked.contradicting > 0 && linked.contradicting + 2 >= landmarks;
    match (refuted, linked.matched) {
        (true, _) => 1.0,
        (false, 0) => false_bound,
        // An alignment that is ambiguous or vague stays so.
        (false, _) if false_bound >= 1.0 => 1.0,
        (false, _) => false_bound * ALIKE,
    }
}

/// Where a landmark seen from a pose is in the pose's own frame of reference.
pub(crate) fn carried(
    reference_from_pose: &geometry::GaussianPose2,
    sighting: &sensing::Sighting,
) -> sensing::Sighting {
    let mean: &Pose2 = &reference_from_pose.mean;
    let jacobian = point_jacobian(mean, &sighting.position);
    let moved = jacobian * reference_from_pose.covariance * jacobian.transpose();
    let turn = reference_from_pose.covariance[(2, 2)];
    sensing::Sighting {
        position: mean.transform(sighting.position),
        covariance: turned(&sighting.covariance, mean.yaw) + moved,
        yaw: sighting.yaw.map(|(yaw, v)| (geometry::wrap_angle(mean.yaw + yaw), v + turn)),
        ..sighting.clone()
    }
}
