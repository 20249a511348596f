use super::grid::{Grid, GridPose};
use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{LieGroup, Matrix3, Pose2, wrap_angle};
use manifold::{Islands, PatchId};
use matching::{FastMatcher, SurfelField};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Where overlaps are measured: a twentieth of the roughness of surfaces (`FieldSettings`). The fit
/// found is next to the same, and a retraction leaves nearly all of them at their places.
const GRID: Grid = Grid::of(5e-4);

/// How two patches fit at a pose close to the present estimate: the minimum of the quadratic model
/// of the fit's cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overlap {
    pub from: PatchId,
    pub to: PatchId,
    /// `from_from_to` where the fit was measured.
    at: GridPose,
    /// They see enough of the same surfaces for this to count.
    pub counts: bool,
    /// `from_from_to` that fits better.
    pub from_from_to: Pose2,
    pub information: Matrix3<f64>,
}

/// For every patch what was measured from it, in the order in which it was tried.
pub(crate) type Overlaps = Vec<Vec<Overlap>>;

/// Measures every pair of patches that see the same surfaces, in both directions. What `overlaps`
/// has of it already, from the last time, is left as it is; what is not needed is removed.
pub(super) fn measure_overlaps(
    overlaps: &mut Overlaps,
    map: &Map,
    islands: &Islands,
    config: &SlamConfig,
    kernel_m: f32,
) {
    let near = PatchGrid::new(map, islands, config.refit.overlap_distance_m);
    let measuring = Measuring { map, config, matcher: config.refit_matcher(), kernel_m };
    let field = SurfelField::new(config.refit_field(), (0.0, 0.0), (0.0, 0.0));
    let patches = map.manifold.patches();
    overlaps.resize_with(patches.len(), Vec::new);
    // Every patch by itself: the same whatever the number of threads.
    patches.par_iter().zip(overlaps).with_min_len(32).for_each_init(
        || field.clone(),
        |scratch, (patch, overlaps)| {
            if patch.left_out {
                overlaps.clear();
                return;
            }
            let distance_m = config.refit.overlap_distance_m;
            let others =
                neighbours_of(patch.id, map, &near, islands.of[patch.id.index()], distance_m);
            measuring.renew(overlaps, patch.id, others, scratch);
        },
    );
}

/// What the measurements of a round have in common.
struct Measuring<'a> {
    map: &'a Map,
    config: &'a SlamConfig,
    matcher: FastMatcher,
    kernel_m: f32,
}

impl Measuring<'_> {
    /// Makes `overlaps` those of a patch with the first of `others` that count.
    fn renew(
        &self,
        overlaps: &mut Vec<Overlap>,
        from: PatchId,
        others: impl Iterator<Item = (PatchId, Pose2)>,
        scratch: &mut SurfelField,
    ) {
        let settings = &self.config.refit;
        let (mut tried, mut counting, mut is_laid) = (0, 0, false);
        for (to, believed) in others {
            if counting >= settings.overlaps_per_patch {
                break;
            }
            let at = GRID.nearest(&believed);
            match overlaps[tried..].iter().position(|o| o.to == to && o.at == at) {
                Some(further) => overlaps.swap(tried, tried + further),
                None => {
                    if !is_laid {
                        let members = [(from, Pose2::IDENTITY)];
                        lay_field(scratch, self.map, &members, f64::from(settings.reach_m));
                        is_laid = true;
                    }
                    overlaps.insert(tried, self.measure(from, to, at, scratch));
                }
            }
            counting += usize::from(overlaps[tried].counts);
            tried += 1;
        }
        overlaps.truncate(tried);
    }

    /// Measures how `to` fits the surfaces of `from`, which are laid in `field`.
    fn measure(&self, from: PatchId, to: PatchId, at: GridPose, field: &SurfelField) -> Overlap {
        let settings = &self.config.refit;
        let pose = GRID.pose(at);
        let (h, g, share) =
            self.matcher.quadratic(field, self.map.surface(to), &pose, self.kernel_m);
        let sharing = self.config.match_correlation * settings.overlap_sharing;
        let (information, gradient) = (h / sharing, g / sharing);
        // Directions that nothing observes stay where they are.
        let damped = (information + Matrix3::identity()).cholesky();
        let step = damped.map(|factor| -factor.solve(&gradient));
        let counts = step.is_some() && share >= settings.overlap_share;
        let from_from_to = step.map_or(pose, |step| pose.retract(&step));
        Overlap { from, to, at, counts, from_from_to, information }
    }
}

/// Patches within the radius of `patch` that may see what it sees, and their poses seen from it,
/// those most alike in place and heading first.
fn neighbours_of(
    patch: PatchId,
    map: &Map,
    near: &PatchGrid,
    island: u32,
    radius_m: f64,
) -> impl Iterator<Item = (PatchId, Pose2)> {
    let own = map.pose(patch);
    let apart = move |other: &Pose2| own.distance(other) + wrap_angle(other.yaw - own.yaw).abs();
    let others = near.around(island, own, radius_m).filter(|(other, _)| *other != patch);
    // Of many the first few are wanted. Numbers that are not negative order as their bits do.
    let others = others.map(|(other, pose)| Reverse((apart(pose).to_bits(), *other)));
    let mut nearest: BinaryHeap<Reverse<(u64, PatchId)>> = others.collect();
    std::iter::from_fn(move || {
        let Reverse((_, other)) = nearest.pop()?;
        Some((other, own.between(&map.pose(other))))
    })
}
