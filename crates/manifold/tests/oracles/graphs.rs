//! What the tests share: small random manifolds.

use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use manifoldslam_manifold::{Manifold, Patch, PatchId, Provenance, SubmapLimits};
use proptest::prelude::*;
use sensing::{LaserModel, RobotId, Scan, Stamp};
use std::sync::Arc;

/// A relation to be made: ends as indices, `from_from_to`.
pub type Link = (usize, usize, GaussianPose2);

pub fn pose() -> impl Strategy<Value = Pose2> {
    (-4.0..4.0, -4.0..4.0, -3.0..3.0).prop_map(|(x, y, yaw)| Pose2::new(x, y, yaw))
}

/// A pose with a full covariance of centimetres and hundredths of a radian.
pub fn gaussian() -> impl Strategy<Value = GaussianPose2> {
    let root = prop::array::uniform9(-0.05..0.05f64);
    (pose(), root).prop_map(|(mean, root)| {
        let root = Matrix3::from_row_slice(&root);
        GaussianPose2 { mean, covariance: root * root.transpose() + Matrix3::identity() * 1e-5 }
    })
}

/// A pose with position noise alone, in any direction.
pub fn gaussian_without_yaw_noise() -> impl Strategy<Value = GaussianPose2> {
    gaussian().prop_map(|g| {
        let keep = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
        GaussianPose2 { covariance: keep * g.covariance * keep, ..g }
    })
}

/// A random tree: each patch but the first hangs on an earlier one.
pub fn tree(patches: usize) -> impl Strategy<Value = Vec<Link>> {
    prop::collection::vec((any::<prop::sample::Index>(), gaussian()), patches - 1)
        .prop_map(|v| v.iter().enumerate().map(|(i, (p, g))| (p.index(i + 1), i + 1, *g)).collect())
}

/// Any relations between different patches, double ones included.
pub fn links(
    patches: usize,
    most: usize,
    step: impl Strategy<Value = GaussianPose2>,
) -> impl Strategy<Value = Vec<Link>> {
    let link = (0..patches, 1..patches, step);
    prop::collection::vec(link.prop_map(move |(a, d, g)| (a, (a + d) % patches, g)), 0..=most)
}

pub fn add_patch(manifold: &mut Manifold, island_from_patch: Pose2) -> PatchId {
    let scan = Arc::new(Scan::classify(LaserModel::half_circle(3), &[1.0, 2.0, 3.0]));
    let stamp = Stamp(manifold.patches().len() as i64);
    manifold.add_patch(Patch {
        id: PatchId::default(),
        robot: RobotId(0),
        stamp,
        scan,
        sweep: None,
        base_from_laser: Pose2::IDENTITY,
        attitude: None,
        island_from_patch,
        elevation: None,
        left_out: false,
    })
}

pub fn build(patches: usize, links: &[Link]) -> Manifold {
    let mut manifold = Manifold::new();
    for i in 0..patches {
        add_patch(&mut manifold, Pose2::new(i as f64, 0.0, 0.0));
    }
    for &(from, to, step) in links {
        manifold.relate(patch(from), patch(to), step, Provenance::Sequential);
    }
    manifold
}

pub fn patch(index: usize) -> PatchId {
    PatchId(index as u32)
}

/// Limits that cut some of the random graphs and not others.
pub fn limits() -> impl Strategy<Value = SubmapLimits> {
    (0.05..0.4, 0.05..0.4, 3.0..12.0, 1..12usize).prop_map(
        |(translation_m, rotation_rad, distance_m, patches)| SubmapLimits {
            translation_m,
            rotation_rad,
            distance_m,
            patches,
        },
    )
}

/// How well every patch is known from `start`.
pub fn known_from(manifold: &Manifold, start: PatchId) -> Vec<Option<GaussianPose2>> {
    let all: Vec<PatchId> = manifold.patches().iter().map(|p| p.id).collect();
    manifold.uncertainty_from(start, &all)
}

/// Everything that can be asked of two manifolds gives the same answer, relation ids aside.
pub fn assert_same_map(a: &Manifold, b: &Manifold, limits: &SubmapLimits) {
    assert_eq!(a.patches(), b.patches());
    assert_eq!(a.islands(), b.islands());
    let active = |m: &Manifold| -> Vec<_> {
        m.active_relations().map(|r| (r.from, r.to, r.from_from_to, r.provenance)).collect()
    };
    assert_eq!(active(a), active(b));
    for start in a.patches().iter().map(|p| p.id) {
        let neighbours = |m: &Manifold| m.neighbours(start).collect::<Vec<_>>();
        assert_eq!(neighbours(a), neighbours(b));
        assert_eq!(a.local_submap(start, limits), b.local_submap(start, limits));
        assert_eq!(known_from(a, start), known_from(b, start));
    }
}
