use super::smoother::{Knowledge, smooth};
use crate::SlamConfig;
use crate::active_submap::lay_field;
use crate::map::Map;
use crate::mapper::{ScanPose, ScanRecord};
use geometry::{Matrix3, Pose2, Vector3};
use manifold::PatchId;
use matching::{FastMatcher, Prior, SurfelField};
use rayon::prelude::*;

/// Standard deviations of a scan's pose before it is matched with the refitted map.
const BEFORE_STD: [f64; 3] = [0.03, 0.03, 0.02];
/// A scan that a match moves farther than this was matched wrongly, metres.
const LARGEST_MOVE_M: f64 = 0.3;
/// Gauss-Newton iterations over the whole trajectory; its starting point is within centimetres.
const SMOOTHING_ITERATIONS: usize = 3;

/// Places every scan in the refitted map: each is matched with the patches around it, and the whole
/// trajectory is then estimated from these matches and the odometry between scans.
pub(crate) fn relocalise(map: &Map, scans: &mut [ScanRecord], config: &SlamConfig) {
    let matcher = &config.refit_matcher();
    let groups = group_patches(map, config.refit.group_radius_m);
    let mut group_of = vec![0; map.manifold.patches().len()];
    for (index, group) in groups.iter().enumerate() {
        for patch in group {
            group_of[patch.index()] = index;
        }
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); groups.len()];
    for (index, scan) in scans.iter().enumerate() {
        members[group_of[scan.pose.patch.index()]].push(index);
    }
    let field = SurfelField::new(config.refit_field(), (0.0, 0.0), (0.0, 0.0));
    let matched: Vec<Vec<Matched>> = (0..groups.len())
        .into_par_iter()
        .map_init(
            || field.clone(),
            |scratch, g| {
                match_group(map, groups[g][0], &members[g], scans, scratch, matcher, config)
            },
        )
        .collect();
    let mut knowledge = before(map, scans, config);
    for m in matched.into_iter().flatten() {
        knowledge[m.scan].measured = m.pose;
        knowledge[m.scan].information = m.information / config.match_correlation;
    }
    let poses = smooth(&knowledge, config.refit.outlier_sigmas, SMOOTHING_ITERATIONS);
    for (scan, pose) in scans.iter_mut().zip(&poses) {
        let patch_from_base = map.pose(scan.pose.patch).between(pose);
        scan.pose = ScanPose { patch: scan.pose.patch, patch_from_base };
    }
}

/// A scan found in the map.
struct Matched {
    scan: usize,
    pose: Pose2,
    information: Matrix3<f64>,
}

/// Patches in groups around the first of each.
fn group_patches(map: &Map, radius_m: f64) -> Vec<Vec<PatchId>> {
    let patches = map.manifold.patches();
    let mut grouped = vec![false; patches.len()];
    let mut groups = Vec::new();
    for centre in patches {
        if grouped[centre.id.index()] {
            continue;
        }
        let near: Vec<PatchId> = patches
            .iter()
            .filter(|p| {
                !grouped[p.id.index()]
                    && p.island_from_patch.distance(&centre.island_from_patch) <= radius_m
                    && map.comparable(centre.id, p.id)
            })
            .map(|p| p.id)
            .collect();
        for patch in &near {
            grouped[patch.index()] = true;
        }
        groups.push(near);
    }
    groups
}

fn match_group(
    map: &Map,
    centre: PatchId,
    members: &[usize],
    scans: &[ScanRecord],
    scratch: &mut SurfelField,
    matcher: &FastMatcher,
    config: &SlamConfig,
) -> Vec<Matched> {
    let origin = map.pose(centre);
    let reach = config.refit.group_radius_m + config.refit.group_margin_m;
    let around: Vec<(PatchId, Pose2)> = map
        .manifold
        .patches()
        .iter()
        .filter(|p| map.comparable(centre, p.id))
        .map(|p| (p.id, origin.between(&p.island_from_patch)))
        .filter(|(_, pose)| pose.norm() <= reach)
        .collect();
    lay_field(scratch, map, &around, f64::from(config.refit.reach_m));
    let information = information_before();
    let place = |&scan: &usize| {
        let pose = origin.between(&scans[scan].pose.in_map(&map.manifold));
        let result =
            matcher.align(scratch, &scans[scan].surface.expand(), &Prior { pose, information });
        let found = result.status.is_usable()
            && result.inlier_ratio > config.refit.overlap_share
            && pose.distance(&result.pose) < LARGEST_MOVE_M;
        let information = result.covariance.try_inverse()?;
        found.then_some(Matched { scan, pose: origin * result.pose, information })
    };
    members.iter().filter_map(place).collect()
}

/// Information of [`BEFORE_STD`].
fn information_before() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(BEFORE_STD).map(|std| std.powi(-2)))
}

/// What is known of the trajectory before matching: the scans' poses and the odometry.
fn before(map: &Map, scans: &[ScanRecord], config: &SlamConfig) -> Vec<Knowledge> {
    let information = information_before();
    let mut last = None;
    scans
        .iter()
        .map(|scan| {
            let now = scan.odom_from_base;
            let motion = match (last, now) {
                (Some(last), Some(now)) => {
                    Some(config.odometry.gaussian(Pose2::between(&last, &now)))
                }
                _ => None,
            };
            last = now;
            Knowledge { measured: scan.pose.in_map(&map.manifold), information, motion }
        })
        .collect()
}
