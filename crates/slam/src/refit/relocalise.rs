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

/// Places every scan in the refitted map: each is matched with the patches around it, and each
/// robot's whole trajectory is then estimated from these matches and the odometry between scans.
pub(crate) fn relocalise(map: &Map, tracks: &mut [&mut [ScanRecord]], config: &SlamConfig) {
    let islands = map.manifold.component_map();
    let groups = group_patches(map, &islands, config.refit.group_radius_m);
    let mut group_of = vec![usize::MAX; map.manifold.patches().len()];
    for (index, group) in groups.iter().enumerate() {
        for patch in group {
            group_of[patch.index()] = index;
        }
    }
    let mut members: Vec<Vec<(usize, usize)>> = vec![Vec::new(); groups.len()];
    for (track, scans) in tracks.iter().enumerate() {
        for (scan, record) in scans.iter().enumerate().filter(|(_, record)| !record.left_out) {
            if let Some(of) = members.get_mut(group_of[record.pose.patch.index()]) {
                of.push((track, scan));
            }
        }
    }
    let reach = config.refit.group_radius_m + config.refit.group_margin_m;
    let near = PatchGrid::new(map, &islands, reach);
    let field = SurfelField::new(config.refit_field(), (0.0, 0.0), (0.0, 0.0));
    let shared: &[&mut [ScanRecord]] = tracks;
    let matched: Vec<Vec<Matched>> = (0..groups.len())
        .into_par_iter()
        .map_init(
            || field.clone(),
            |scratch, g| {
                let centre = groups[g][0];
                let island = islands.of[centre.index()];
                let around = near.within(map, island, &map.pose(centre), reach);
                match_group(map, centre, &around, &members[g], shared, scratch, config)
            },
        )
        .collect();
    let mut knowledge: Vec<Vec<Knowledge>> =
        tracks.iter().map(|scans| before(map, &islands, scans, config)).collect();
    for m in matched.into_iter().flatten() {
        let known = &mut knowledge[m.track][m.scan];
        known.measured = m.pose;
        known.information = m.information / config.match_correlation;
    }
    tracks.par_iter_mut().zip(&knowledge).for_each(|(scans, knowledge)| {
        let poses = smooth(knowledge, config.refit.outlier_sigmas, SMOOTHING_ITERATIONS);
        for (scan, pose) in scans.iter_mut().zip(&poses) {
            let patch_from_base = map.pose(scan.pose.patch).between(pose);
            scan.pose = ScanPose { patch: scan.pose.patch, patch_from_base };
        }
    });
}

/// A scan found in the map.
struct Matched {
    track: usize,
    scan: usize,
    pose: Pose2,
    information: Matrix3<f64>,
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

fn match_group(
    map: &Map,
    centre: PatchId,
    around: &[PatchId],
    members: &[(usize, usize)],
    tracks: &[&mut [ScanRecord]],
    scratch: &mut SurfelField,
    config: &SlamConfig,
) -> Vec<Matched> {
    let origin = map.pose(centre);
    let comparable = around.iter().filter(|p| map.comparable(centre, **p));
    let around: Vec<(PatchId, Pose2)> =
        comparable.map(|&p| (p, origin.between(&map.pose(p)))).collect();
    lay_field(scratch, map, &around, f64::from(config.refit.reach_m));
    let matcher = config.refit_matcher();
    let information = information_before();
    let place = |&(track, scan): &(usize, usize)| {
        let record = &tracks[track][scan];
        let surface = record.surface.expand();
        let pose = origin.between(&record.found.in_map(&map.manifold));
        let result = matcher.align(scratch, &surface, &Prior { pose, information });
        let found = result.status.is_usable()
            && result.inlier_ratio > config.refit.overlap_share
            && pose.distance(&result.pose) < LARGEST_MOVE_M;
        let information = result.covariance.try_inverse()?;
        found.then_some(Matched { track, scan, pose: origin * result.pose, information })
    };
    members.iter().filter_map(place).collect()
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
