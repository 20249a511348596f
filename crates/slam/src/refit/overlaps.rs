use super::grid::{Grid, GridPose};
use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{LieGroup, Matrix3, Pose2, Vector3, wrap_angle};
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
    /// It depends on the two scans and on `at` alone.
    lasts: bool,
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
            let same = |o: &Overlap| o.to == to && o.at == at && o.lasts;
            let is_known = self.is_the_same_in_any_map(from, to);
            match overlaps[tried..].iter().position(|o| is_known && same(o)) {
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

    fn is_the_same_in_any_map(&self, from: PatchId, to: PatchId) -> bool {
        self.map.is_the_same_in_any_map(from) && self.map.is_the_same_in_any_map(to)
    }

    /// Measures how `to` fits the surfaces of `from`, which are laid in `field`.
    fn measure(&self, from: PatchId, to: PatchId, at: GridPose, field: &SurfelField) -> Overlap {
        let settings = &self.config.refit;
        let pose = GRID.pose(at);
        let surface = self.map.comparable_surface(from, to);
        let (h, g, share) = self.matcher.quadratic(field, &surface, &pose, self.kernel_m);
        let sharing = self.config.match_correlation * settings.overlap_sharing;
        let (mut information, mut gradient) = (h / sharing, g / sharing);
        if !(self.map.is_level(from) && self.map.is_level(to)) {
            forget_what_is_not_observed(&mut information, &mut gradient);
        }
        // Directions that nothing observes stay where they are.
        let damped = (information + Matrix3::identity()).cholesky();
        let step = damped.map(|factor| -factor.solve(&gradient));
        let counts = step.is_some() && share >= settings.overlap_share;
        let from_from_to = step.map_or(pose, |step| pose.retract(&step));
        let lasts = self.is_the_same_in_any_map(from, to);
        Overlap { from, to, at, lasts, counts, from_from_to, information }
    }
}

/// A direction with a smaller share of the best one's information is not observed.
const OBSERVED_SHARE: f64 = 0.02;

/// Takes the direction out of a quadratic model in which nothing is observed, if there is one
/// (solution remapping, Zhang, Kaess and Singh 2016). Beside a ramp there is nothing but its walls:
/// what little they say along the ramp is the pattern of the beams on them, which is the same in
/// every scan, and pulls the patches of a drive together.
fn forget_what_is_not_observed(information: &mut Matrix3<f64>, gradient: &mut Vector3<f64>) {
    let translation = information.fixed_view::<2, 2>(0, 0).into_owned();
    let eigen = translation.symmetric_eigen();
    let (low, high) = (eigen.eigenvalues.imin(), eigen.eigenvalues.imax());
    if eigen.eigenvalues[low] >= OBSERVED_SHARE * eigen.eigenvalues[high] {
        return;
    }
    let along = eigen.eigenvectors.column(low);
    let along = Vector3::new(along[0], along[1], 0.0);
    let across = Matrix3::identity() - along * along.transpose();
    *information = across * *information * across;
    *gradient = across * *gradient;
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
    let others = near
        .around(island, own, radius_m)
        .filter(move |(other, _)| *other != patch && !map.manifold.apart_in_height(patch, *other));
    // Of many the first few are wanted. Numbers that are not negative order as their bits do.
    let others = others.map(|(other, pose)| Reverse((apart(pose).to_bits(), *other)));
    let mut nearest: BinaryHeap<Reverse<(u64, PatchId)>> = others.collect();
    std::iter::from_fn(move || {
        let Reverse((_, other)) = nearest.pop()?;
        Some((other, own.between(&map.pose(other))))
    })
}
