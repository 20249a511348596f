use super::alignment::point_jacobian;
use super::consensus::GATE_CHI2;
use super::island::{IslandLandmark, turned};
use crate::SlamConfig;
use crate::loop_closing::{Candidate, Closure, Rejection, SearchArea, Verifier};
use crate::map::Map;
use crate::merging::Link;
use geometry::{GaussianPose2, Matrix2, Matrix3, Pose2};
use manifold::{PatchId, Provenance};
use sensing::LandmarkKind;

/// Links between two islands, and what the scans at the landmarks say to them.
#[derive(Clone, Debug, Default)]
pub(super) struct Linked {
    pub links: Vec<Link>,
    /// Landmarks at which the scans match.
    pub matched: usize,
    /// Landmarks at which one island's scans look through the other's walls.
    pub contradicting: usize,
}

/// Two places of one landmark differ by at least so much, m^2: see `alignment::FLOOR_M2`.
const FLOOR_M2: f64 = 4e-4;
/// Walls can only speak against a link known better than this, metres.
const KNOWN_M: f64 = 0.3;
/// Scans are matched at so many landmarks at most, the first ones.
const MOST_MATCHES: usize = 12;

/// Relates the patches from which each pair of landmarks is seen: by a match of their scans with
/// the target's local submap where they match (algorithm 5.5, lines 15 to 23), else by the landmark
/// itself. The source's frame seen from the target's is known as `alignment` says.
pub(super) fn link(
    map: &Map,
    pairs: &[(&IslandLandmark, &IslandLandmark)],
    alignment: &GaussianPose2,
    config: &SlamConfig,
) -> Linked {
    let mut verifier = Verifier::new(config);
    let mut linked = Linked::default();
    for (i, (target, source)) in pairs.iter().enumerate() {
        let mut link = by_landmark(target, source, alignment, pairs.len());
        let has_scans = has_surface(map, target.patch) && has_surface(map, source.patch);
        if i < MOST_MATCHES && has_scans && config.merging.landmarks.match_scans {
            match matched(&mut verifier, map, &link) {
                Ok(closure) => {
                    linked.matched += 1;
                    link.from_from_to = config.closure_relation(&closure.result);
                }
                Err(Rejection::SeenThrough) if is_known(&link.from_from_to) => {
                    linked.contradicting += 1;
                }
                Err(_) => {}
            }
        }
        linked.links.push(link);
    }
    linked
}

/// The relation by which two patches see a landmark at one place.
///
/// The pose follows the alignment's yaw and puts the landmarks onto each other (algorithm 5.3,
/// lines 1 and 2, composed on SE(2)). Its information is that of the landmark alone, `H^T C^-1 H`
/// with `H` the derivative of the landmark's place, and for the yaw a share of what the alignment
/// knows: all links together know no more than it does.
fn by_landmark(
    target: &IslandLandmark,
    source: &IslandLandmark,
    alignment: &GaussianPose2,
    links: usize,
) -> Link {
    let source_pose = alignment.mean * source.island_from_patch;
    let yaw = target.island_from_patch.between(&source_pose).yaw;
    let turn = Pose2::new(0.0, 0.0, yaw);
    let shift = target.position - turn.transform(source.position);
    let mean = Pose2::new(shift.x, shift.y, yaw);
    let spread =
        target.covariance + turned(&source.covariance, yaw) + Matrix2::identity() * FLOOR_M2;
    let yaw_variance = (alignment.covariance[(2, 2)] * links as f64).max(1e-8);
    let covariance = overlay_covariance(&mean, source, &spread, yaw_variance);
    let provenance = match target.kind {
        LandmarkKind::Robot => Provenance::Rendezvous,
        LandmarkKind::Victim | LandmarkKind::Tag => Provenance::Landmark,
    };
    let from_from_to = GaussianPose2 { mean, covariance };
    Link { from: target.patch, to: source.patch, from_from_to, provenance }
}

/// Covariance of a pose that keeps a landmark of the source within `spread` of where the target
/// sees it, and the yaw within its variance: the inverse of both informations' sum.
pub(super) fn overlay_covariance(
    mean: &Pose2,
    source: &IslandLandmark,
    spread: &Matrix2<f64>,
    yaw_variance: f64,
) -> Matrix3<f64> {
    let jacobian = point_jacobian(mean, &source.position);
    let weight = spread.try_inverse().unwrap_or_else(Matrix2::zeros);
    let mut information = jacobian.transpose() * weight * jacobian;
    information[(2, 2)] += 1.0 / yaw_variance;
    information.try_inverse().unwrap_or_else(|| Matrix3::identity() * 1e3)
}

/// A match of the link's patches that agrees with it.
fn matched(verifier: &mut Verifier, map: &Map, link: &Link) -> Result<Closure, Rejection> {
    let area = SearchArea::Believed;
    let candidate = Candidate { patch: link.from, patch_from_query: link.from_from_to, area };
    let closure = verifier.verify(link.to, &candidate, map)?;
    if closure.surprise > GATE_CHI2[2] { Err(Rejection::Implausible) } else { Ok(closure) }
}

/// True where a patch has surfaces to match: they come with a robot's whole map.
pub(super) fn has_surface(map: &Map, patch: PatchId) -> bool {
    map.surfaces.get(patch.index()).is_some_and(|surface| !surface.is_empty())
}

fn is_known(pose: &GaussianPose2) -> bool {
    pose.covariance[(0, 0)].max(pose.covariance[(1, 1)]) < KNOWN_M * KNOWN_M
}
