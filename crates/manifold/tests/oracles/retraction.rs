//! A map with a relation taken back is the map that never had it.

use crate::graphs::{assert_same_map, build, gaussian, limits, links, patch};
use manifoldslam_manifold::{Provenance, RelationId, Retraction};
use proptest::prelude::*;

proptest! {
    #[test]
    fn retracted_is_as_if_never_related(
        links in links(8, 14, gaussian()),
        kept in prop::collection::vec(any::<bool>(), 14),
        limits in limits(),
    ) {
        let mut manifold = build(8, &links);
        for (i, _) in links.iter().enumerate().filter(|(i, _)| !kept[*i]) {
            manifold.retract(RelationId(i as u32), Retraction::ByUser);
        }
        let without: Vec<_> =
            links.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(link, _)| *link).collect();
        assert_same_map(&manifold, &build(8, &without), &limits);
        prop_assert_eq!(manifold.relations().len(), links.len(), "the record is kept");
    }
}

#[test]
fn retracting_twice_is_retracting_once() {
    let step = geometry::GaussianPose2::exact(geometry::Pose2::new(1.0, 0.0, 0.0));
    let mut manifold = build(2, &[(0, 1, step), (0, 1, step)]);
    manifold.take_journal();
    manifold.retract(RelationId(0), Retraction::ByUser);
    manifold.retract(RelationId(0), Retraction::ByUser);
    assert_eq!(manifold.take_journal().len(), 1);
    assert_eq!(manifold.islands().len(), 1, "the other relation still holds");
}

proptest! {
    /// Taking a relation back and in again changes nothing; a proposed one counts once confirmed.
    #[test]
    fn confirmed_is_as_if_related_from_the_start(
        links in links(8, 14, gaussian()),
        late in prop::collection::vec(0..3u8, 14),
        limits in limits(),
    ) {
        let mut manifold = build(8, &[]);
        for ((from, to, step), late) in links.iter().zip(&late) {
            let (from, to) = (patch(*from), patch(*to));
            match late {
                0 => manifold.relate(from, to, *step, Provenance::Sequential),
                _ => manifold.propose(from, to, *step, Provenance::Sequential),
            };
        }
        for (i, _) in late.iter().zip(&links).enumerate().filter(|(_, (late, _))| **late == 1) {
            manifold.retract(RelationId(i as u32), Retraction::Contradicted);
        }
        for i in (0..links.len()).rev() {
            manifold.confirm(RelationId(i as u32));
        }
        assert_same_map(&manifold, &build(8, &links), &limits);
    }
}
