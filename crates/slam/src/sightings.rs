use crate::front_end::Localisation;
use crate::map::Map;
use crate::merging::carried;
use geometry::GaussianPose2;
use manifold::PatchSighting;
use sensing::{Sighting, Stamp};

/// Stores the landmarks seen at a scan on the scan's patch, through the scan's pose there and with
/// its doubt.
pub(crate) fn note_sightings(
    map: &mut Map,
    found: &Localisation,
    stamp: Stamp,
    sightings: &[Sighting],
) {
    let pose = GaussianPose2 { mean: found.patch_from_base, covariance: found.covariance };
    for sighting in sightings {
        let sighting = carried(&pose, sighting);
        map.manifold.note_sighting(PatchSighting { patch: found.patch, stamp, sighting });
    }
}
