use super::alignment::point_jacobian;
use super::consensus::GATE_CHI2;
use super::island::{IslandLandmark, IslandLandmarks, turned};
use super::links::has_surface;
use crate::SlamConfig;
use crate::loop_closing::{Candidate, SearchArea, Verifier};
use crate::map::Map;
use crate::merging::{EvidenceCounts, Link, Proposal};
use geometry::{GaussianPose2, Matrix2, Matrix3, Pose2, Vector3};
use manifold::Provenance;
use sensing::LandmarkKind;
use std::f64::consts::PI;

/// Chance that a scan fits, with no rival and looking through no walls, at a landmark that is
/// another: one look-alike in twenty places.
const ALIKE: f64 = 0.05;

/// One landmark and a match of the scans at it: the landmark gives the place, the match the rest.
///
/// Only where the islands have a single landmark in common: of several that do not agree none is
/// trusted.
pub(super) fn one_and_a_match(
    map: &Map,
    target: &IslandLandmarks,
    source: &IslandLandmarks,
    config: &SlamConfig,
) -> Option<Proposal> {
    let (t, s) = only_pair(target, source)?;
    if !config.merging.landmarks.match_scans
        || !has_surface(map, t.patch)
        || !has_surface(map, s.patch)
    {
        return None;
    }
    let candidate = Candidate {
        patch: t.patch,
        patch_from_query: anywhere_around(t, s),
        area: SearchArea::Believed,
    };
    let closure = Verifier::new(config).verify(s.patch, &candidate, map).ok()?;
    let pose = closure.result.pose;
    let error = pose.transform(s.position) - t.position;
    let jacobian = point_jacobian(&pose, &s.position);
    let spread = t.covariance
        + turned(&s.covariance, pose.yaw)
        + jacobian * config.closure_relation(&closure.result).covariance * jacobian.transpose();
    if error.dot(&(spread.try_inverse()? * error)) > GATE_CHI2[1] {
        return None;
    }
    let (provenance, wrong) = match t.kind {
        LandmarkKind::Robot => (Provenance::Rendezvous, 0.0),
        LandmarkKind::Victim | LandmarkKind::Tag => {
            (Provenance::Landmark, config.merging.landmarks.wrong_ids)
        }
    };
    let from_from_to = config.closure_relation(&closure.result);
    Some(Proposal {
        target_from_source: t.island_from_patch * pose * s.island_from_patch.inverse(),
        evidence: EvidenceCounts { matches: 1, agreeing: 1, ..EvidenceCounts::default() },
        most_false: config.merging.landmarks.false_merges,
        links: vec![Link { from: t.patch, to: s.patch, from_from_to, provenance }],
        // The robot that was met is near for certain; how it lies to the other the match must tell.
        false_bound: ALIKE * if wrong > 0.0 { wrong / (1.0 - wrong) } else { 1.0 },
    })
}

/// The only pair of landmarks with the same id.
fn only_pair<'a>(
    target: &'a IslandLandmarks,
    source: &'a IslandLandmarks,
) -> Option<(&'a IslandLandmark, &'a IslandLandmark)> {
    let mut pairs = target.landmarks.iter().flat_map(|t| {
        let same = move |s: &&IslandLandmark| s.id.is_some() && (s.kind, &s.id) == (t.kind, &t.id);
        source.landmarks.iter().filter(same).map(move |s| (t, s))
    });
    pairs.next().filter(|_| pairs.next().is_none())
}

/// The source's patch, with any heading, so that the landmark is where the target sees it: on a
/// circle around it, whose box this Gaussian's three standard deviations are.
fn anywhere_around(target: &IslandLandmark, source: &IslandLandmark) -> GaussianPose2 {
    let spread = target.covariance + source.covariance;
    let sigma = spread.trace().sqrt();
    let std = source.position.norm() / 3.0 + sigma;
    let axes = Matrix2::identity() * (std * std);
    let mut covariance = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, PI * PI / 3.0));
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&axes);
    let mean = Pose2::new(target.position.x, target.position.y, 0.0);
    GaussianPose2 { mean, covariance }
}
