use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use geometry::{Matrix3, Pose2, Vector3};
use manifold::PatchId;
use matching::{FastMatcher, SurfelField};
use rayon::prelude::*;
use std::collections::BTreeMap;

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
    matcher: &FastMatcher,
    config: &SlamConfig,
    kernel_m: f32,
) -> Vec<Overlap> {
    let near = Neighbourhood::new(map, config.refit.overlap_distance_m);
    let ids: Vec<PatchId> = map.manifold.patches().iter().map(|p| p.id).collect();
    let field = SurfelField::new(config.refit_field(), (0.0, 0.0), (0.0, 0.0));
    // Fixed blocks, results in order: the same whatever the number of threads.
    ids.par_chunks(32)
        .map_init(
            || field.clone(),
            |scratch, block| {
                let of = |&from| overlaps_of(from, map, &near, scratch, matcher, config, kernel_m);
                block.iter().flat_map(of).collect::<Vec<_>>()
            },
        )
        .flatten_iter()
        .collect()
}

fn overlaps_of(
    from: PatchId,
    map: &Map,
    near: &Neighbourhood,
    scratch: &mut SurfelField,
    matcher: &FastMatcher,
    config: &SlamConfig,
    kernel_m: f32,
) -> Vec<Overlap> {
    let settings = &config.refit;
    lay_field(scratch, map, &[(from, Pose2::IDENTITY)], f64::from(config.refit.reach_m));
    let mut overlaps = Vec::with_capacity(settings.overlaps_per_patch);
    for (to, believed) in near.of(from, map) {
        if overlaps.len() >= settings.overlaps_per_patch {
            break;
        }
        let (h, g, share) = matcher.quadratic(scratch, map.surface(to), &believed, kernel_m);
        if share < settings.overlap_share {
            continue;
        }
        let information = h / (config.match_correlation * settings.overlap_sharing);
        let gradient = g / (config.match_correlation * settings.overlap_sharing);
        // Directions that nothing observes stay where they are.
        let damped = information + Matrix3::identity();
        let Some(factor) = damped.cholesky() else { continue };
        let step = -factor.solve(&gradient);
        overlaps.push(Overlap { from, to, believed, step, information });
    }
    overlaps
}

/// Patches by place, to find those near another without looking at all.
struct Neighbourhood {
    radius_m: f64,
    cells: BTreeMap<(i64, i64), Vec<PatchId>>,
}

impl Neighbourhood {
    fn new(map: &Map, radius_m: f64) -> Self {
        let mut cells: BTreeMap<(i64, i64), Vec<PatchId>> = BTreeMap::new();
        for patch in map.manifold.patches() {
            cells.entry(cell_of(&patch.island_from_patch, radius_m)).or_default().push(patch.id);
        }
        Neighbourhood { radius_m, cells }
    }

    /// Patches within the radius of `patch` and their poses seen from it, those most alike in place
    /// and heading first.
    fn of(&self, patch: PatchId, map: &Map) -> Vec<(PatchId, Pose2)> {
        let own = map.pose(patch);
        let (u, v) = cell_of(&own, self.radius_m);
        let mut found: Vec<(f64, PatchId, Pose2)> = (-1..=1)
            .flat_map(|dv| (-1..=1).map(move |du| (u + du, v + dv)))
            .filter_map(|cell| self.cells.get(&cell))
            .flatten()
            .filter(|&&other| other != patch && map.comparable(patch, other))
            .map(|&other| (other, own.between(&map.pose(other))))
            .filter(|(_, pose)| pose.norm() <= self.radius_m)
            .map(|(other, pose)| (pose.norm() + pose.yaw.abs(), other, pose))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.into_iter().map(|(_, other, pose)| (other, pose)).collect()
    }
}

fn cell_of(pose: &Pose2, size_m: f64) -> (i64, i64) {
    ((pose.x / size_m).floor() as i64, (pose.y / size_m).floor() as i64)
}
