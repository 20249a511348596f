use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{Matrix3, Pose2, Vector3};
use manifold::{Islands, PatchId};
use matching::{FastMatcher, SurfelField};
use rayon::prelude::*;

/// How two overlapping patches fit at the present estimate: the quadratic model of the fit's cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overlap {
    pub from: PatchId,
    pub to: PatchId,
    /// Present `from_from_to`.
    pub believed: Pose2,
    /// Right perturbation of it that fits better.
    pub step: Vector3<f64>,
    pub information: Matrix3<f64>,
}

/// Measures every pair of patches that see the same surfaces, in both directions.
pub(crate) fn measure_overlaps(
    map: &Map,
    islands: &Islands,
    matcher: &FastMatcher,
    config: &SlamConfig,
    kernel_m: f32,
) -> Vec<Overlap> {
    let near = PatchGrid::new(map, islands, config.refit.overlap_distance_m);
    let ids: Vec<PatchId> =
        map.manifold.patches().iter().filter(|p| !p.left_out).map(|p| p.id).collect();
    let field = SurfelField::new(config.refit_field(), (0.0, 0.0), (0.0, 0.0));
    // Fixed blocks, results in order: the same whatever the number of threads.
    ids.par_chunks(32)
        .map_init(
            || field.clone(),
            |scratch, block| {
                let of = |&from: &PatchId| {
                    let distance_m = config.refit.overlap_distance_m;
                    let island = islands.of[from.index()];
                    let others = neighbours_of(from, map, &near, island, distance_m);
                    overlaps_of(from, &others, map, scratch, matcher, config, kernel_m)
                };
                block.iter().flat_map(of).collect::<Vec<_>>()
            },
        )
        .flatten_iter()
        .collect()
}

fn overlaps_of(
    from: PatchId,
    others: &[(PatchId, Pose2)],
    map: &Map,
    scratch: &mut SurfelField,
    matcher: &FastMatcher,
    config: &SlamConfig,
    kernel_m: f32,
) -> Vec<Overlap> {
    let settings = &config.refit;
    lay_field(scratch, map, &[(from, Pose2::IDENTITY)], f64::from(config.refit.reach_m));
    let mut overlaps = Vec::with_capacity(settings.overlaps_per_patch);
    for &(to, believed) in others {
        if overlaps.len() >= settings.overlaps_per_patch {
            break;
        }
        let (h, g, share) =
            matcher.quadratic(scratch, &map.comparable_surface(from, to), &believed, kernel_m);
        if share < settings.overlap_share {
            continue;
        }
        let mut information = h / (config.match_correlation * settings.overlap_sharing);
        let mut gradient = g / (config.match_correlation * settings.overlap_sharing);
        if !(map.is_level(from) && map.is_level(to)) {
            forget_what_is_not_observed(&mut information, &mut gradient);
        }
        // Directions that nothing observes stay where they are.
        let damped = information + Matrix3::identity();
        let Some(factor) = damped.cholesky() else { continue };
        let step = -factor.solve(&gradient);
        overlaps.push(Overlap { from, to, believed, step, information });
    }
    overlaps
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
) -> Vec<(PatchId, Pose2)> {
    let own = map.pose(patch);
    let mut found: Vec<(f64, PatchId, Pose2)> = near
        .within(map, island, &own, radius_m)
        .into_iter()
        .filter(|&other| other != patch && !map.manifold.apart_in_height(patch, other))
        .map(|other| (other, own.between(&map.pose(other))))
        .map(|(other, pose)| (pose.norm() + pose.yaw.abs(), other, pose))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    found.into_iter().map(|(_, other, pose)| (other, pose)).collect()
}
