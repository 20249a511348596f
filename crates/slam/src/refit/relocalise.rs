use super::Memory;
use super::grid::{Grid, GridPose};
use super::smoother::{Knowledge, smooth};
use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use crate::track::{ScanPose, ScanRecord};
use geometry::{Matrix3, Pose2, Vector3};
use manifold::{Islands, PatchId};
use matching::{Prior, SurfelField};
use rayon::prelude::*;

/// Standard deviations of a scan's pose before it is matched with the refitted map.
const BEFORE_STD: [f64; 3] = [0.03, 0.03, 0.02];
/// A scan that a match moves farther than this was matched wrongly, metres.
const LARGEST_MOVE_M: f64 = 0.3;
/// Gauss-Newton iterations over the whole trajectory; its starting point is within centimetres.
const SMOOTHING_ITERATIONS: usize = 3;
/// Where patches are laid around the first of a group: coarser than overlaps are measured, since
/// surfaces are averaged over many patches, and all of them must stay at their places for the group
/// to be the same as before.
const GRID: Grid = Grid::of(2e-3);

/// Places every scan in the refitted map: each is matched with the patches around it, and each
/// robot's whole trajectory is then estimated from these matches and the odometry between scans.
pub(crate) fn relocalise(
    map: &Map,
    tracks: &mut [&mut [ScanRecord]],
    config: &SlamConfig,
    memory: &mut Memory,
) {
    let islands = map.manifold.component_map();
    let groups = group_patches(map, &islands, config.refit.group_radius_m);
    let members = scans_of(&groups, map, tracks);
    let reach = config.refit.group_radius_m + config.refit.group_margin_m;
    let near = PatchGrid::new(map, &islands, reach);
    let field = SurfelField::new(config.refit_field(), (0.0, 0.0), (0.0, 0.0));
    let (shared, last): (&[&mut [ScanRecord]], _) = (tracks, &memory.placed);
    let placed: Vec<Placed> = groups
        .into_par_iter()
        .zip(&members)
        .map_init(
            || field.clone(),
            |scratch, (group, members)| {
                let layout = Layout::around(group, map, &islands, &near, reach);
                match last.get(&layout.centre()) {
                    Some(known) if layout.lasts && known.layout == layout => known.clone(),
                    _ => place_group(layout, map, members, shared, scratch, config),
                }
            },
        )
        .collect();
    let mut knowledge: Vec<Vec<Knowledge>> =
        tracks.iter().map(|scans| before(map, &islands, scans, config)).collect();
    for group in &placed {
        let origin = map.pose(group.layout.centre());
        for m in &group.scans {
            let known = &mut knowledge[m.track][m.scan];
            known.measured = origin * m.centre_from_base;
            known.information = m.information / config.match_correlation;
        }
    }
    memory.placed = placed.into_iter().map(|group| (group.layout.centre(), group)).collect();
    tracks.par_iter_mut().zip(&knowledge).for_each(|(scans, knowledge)| {
        let poses = smooth(knowledge, config.refit.outlier_sigmas, SMOOTHING_ITERATIONS);
        for (scan, pose) in scans.iter_mut().zip(&poses) {
            let patch_from_base = map.pose(scan.pose.patch).between(pose);
            scan.pose = ScanPose { patch: scan.pose.patch, patch_from_base };
        }
    });
}

/// A group of patches, and all around it in the frame of its first.
#[derive(Clone, Debug, PartialEq)]
struct Layout {
    group: Vec<PatchId>,
    /// By id, the group included.
    around: Vec<(PatchId, GridPose)>,
    /// What is seen in it depends on it alone.
    lasts: bool,
}

impl Layout {
    fn around(
        group: Vec<PatchId>,
        map: &Map,
        islands: &Islands,
        near: &PatchGrid,
        reach_m: f64,
    ) -> Self {
        let origin = map.pose(group[0]);
        let around = near.within(map, islands.of[group[0].index()], &origin, reach_m);
        let seen = |patch: PatchId| GRID.nearest(&origin.between(&map.pose(patch)));
        let around = around.into_iter().filter(|patch| map.comparable(group[0], *patch));
        let around: Vec<_> = around.map(|patch| (patch, seen(patch))).collect();
        let lasts = around.iter().all(|(patch, _)| map.is_the_same_in_any_map(*patch));
        Layout { group, around, lasts }
    }

    fn centre(&self) -> PatchId {
        self.group[0]
    }

    /// A patch seen from the centre.
    fn pose(&self, patch: PatchId) -> Option<Pose2> {
        let place = self.around.binary_search_by_key(&patch, |(patch, _)| *patch).ok()?;
        Some(GRID.pose(self.around[place].1))
    }
}

/// The scans of a group as they were found in a layout.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    layout: Layout,
    scans: Vec<Matched>,
}

/// A scan found in the map.
#[derive(Clone, Copy, Debug)]
struct Matched {
    track: usize,
    scan: usize,
    centre_from_base: Pose2,
    information: Matrix3<f64>,
}

/// For every group the scans that hang on its patches: track and index.
fn scans_of(
    groups: &[Vec<PatchId>],
    map: &Map,
    tracks: &[&mut [ScanRecord]],
) -> Vec<Vec<(usize, usize)>> {
    let mut group_of = vec![usize::MAX; map.manifold.patches().len()];
    for (index, group) in groups.iter().enumerate() {
        for patch in group {
            group_of[patch.index()] = index;
        }
    }
    let mut members: Vec<Vec<(usize, usize)>> = vec![Vec::new(); groups.len()];
    for (track, scans) in tracks.iter().enumerate() {
        for (scan, record) in scans.iter().enumerate().filter(|(_, record)| !record.left_out) {
            if let Some(of) = members.get_mut(group_of[record.found.patch.index()]) {
                of.push((track, scan));
            }
        }
    }
    members
}

/// Patches in groups around the first of each.
fn group_patches(map: &Map, islands: &Islands, radius_m: f64) -> Vec<Vec<PatchId>> {
    let near = PatchGrid::new(map, islands, radius_m);
    let patches = map.manifold.patches();
    let mut grouped: Vec<bool> = patches.iter().map(|p| p.left_out).collect();
    let mut groups = Vec::new();
    for centre in patches {
        if grouped[centre.id.index()] {
            continue;
        }
        let island = islands.of[centre.id.index()];
        let mut group = near.within(map, island, &centre.island_from_patch, radius_m);
        group.retain(|p| !grouped[p.index()] && map.comparable(centre.id, *p));
        for patch in &group {
            grouped[patch.index()] = true;
        }
        // The centre is the first by id of those left, and so of its group.
        groups.push(group);
    }
    groups
}

/// Matches the scans of a group with the patches around it.
fn place_group(
    layout: Layout,
    map: &Map,
    members: &[(usize, usize)],
    tracks: &[&mut [ScanRecord]],
    scratch: &mut SurfelField,
    config: &SlamConfig,
) -> Placed {
    let around: Vec<(PatchId, Pose2)> =
        layout.around.iter().map(|&(patch, seen)| (patch, GRID.pose(seen))).collect();
    lay_field(scratch, map, &around, f64::from(config.refit.reach_m));
    let matcher = config.refit_matcher();
    let information = information_before();
    let place = |&(track, scan): &(usize, usize)| {
        let record = &tracks[track][scan];
        let surface = record.surface.expand();
        let pose = layout.pose(record.found.patch)? * record.found.patch_from_base;
        let result = matcher.align(scratch, &surface, &Prior { pose, information });
        let found = result.status.is_usable()
            && result.inlier_ratio > config.refit.overlap_share
            && pose.distance(&result.pose) < LARGEST_MOVE_M;
        let information = result.covariance.try_inverse()?;
        found.then_some(Matched { track, scan, centre_from_base: result.pose, information })
    };
    let scans = members.iter().filter_map(place).collect();
    Placed { layout, scans }
}

/// Information of [`BEFORE_STD`].
fn information_before() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(BEFORE_STD).map(|std| std.powi(-2)))
}

/// What is known of the trajectory before matching: the scans' poses and the odometry.
fn before(
    map: &Map,
    islands: &Islands,
    scans: &[ScanRecord],
    config: &SlamConfig,
) -> Vec<Knowledge> {
    let information = information_before();
    let mut last = None;
    scans
        .iter()
        .map(|scan| {
            // Poses of different islands say nothing of each other, nor does odometry on a mishap.
            let reading = scan.odom_from_base.filter(|_| !scan.left_out);
            let now = reading.map(|odom| (islands.of(scan.pose.patch), odom));
            let motion = match (last, now) {
                (Some((island, last)), Some((own, now))) if island == own => {
                    Some(config.odometry.gaussian(Pose2::between(&last, &now)))
                }
                _ => None,
            };
            last = now;
            Knowledge { measured: scan.found.in_map(&map.manifold), information, motion }
        })
        .collect()
}
