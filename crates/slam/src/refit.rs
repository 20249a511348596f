use crate::active_submap::PatchPoints;
use crate::mapper::ScanPose;
use crate::smoother::{Knowledge, smooth};
use geometry::{GaussianPose2, LieGroup, Matrix3, Pose2};
use manifold::{Manifold, PatchId, Provenance};
use matching::{FastMatcher, FieldSettings, LinePoint, Prior, SurfelField};
use optimizer::{Edge, EdgeKind, Kernel, PoseGraph, Settings, optimize};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The global refit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RefitSettings {
    /// Rounds of measuring overlaps and re-estimating all poses.
    pub rounds: usize,
    /// Patches farther apart are not compared, metres.
    pub overlap_distance_m: f64,
    /// At most this many overlaps are measured from each patch, the nearest first.
    pub overlaps_per_patch: usize,
    /// Smallest share of a scan that must fit for an overlap to count.
    pub overlap_share: f64,
    /// Kernel scale of the first round's measurements, metres.
    pub kernel_m: f64,
    /// Information of overlaps is divided by this: neighbouring points are not independent.
    pub overlap_inflation: f64,
    /// Sequential information is divided by this.
    pub seq_inflation: f64,
    /// Radius of final clusters
    pub reloc_prior: f64,
    /// x
    pub unary_inflation: f64,
    /// x
    pub cluster_m: f64,
    pub cluster_reach_m: f64,
}

impl Default for RefitSettings {
    fn default() -> Self {
        RefitSettings {
            rounds: 3,
            overlap_distance_m: 4.0,
            overlaps_per_patch: 12,
            overlap_share: 0.3,
            kernel_m: 0.1,
            overlap_inflation: 100.0,
            seq_inflation: 100.0,
            reloc_prior: 0.1,
            unary_inflation: 10.0,
            cluster_m: 3.0,
            cluster_reach_m: 6.0,
        }
    }
}

/// Re-estimates all patch poses from the active relations.
pub(crate) fn optimise(manifold: &mut Manifold, kernel: Kernel) {
    optimise_with(manifold, &[], kernel, 1.0)
}

struct Overlap {
    from: PatchId,
    to: PatchId,
    mean: Pose2,
    information: Matrix3<f64>,
}

fn optimise_with(manifold: &mut Manifold, overlaps: &[Overlap], kernel: Kernel, seq_inflation: f64) {
    let mut graph = PoseGraph::<Pose2, 3>::new();
    for patch in manifold.patches() {
        let _ = graph.add_node(u64::from(patch.id.0), patch.island_from_patch);
    }
    for r in manifold.active_relations() {
        let Some(information) = r.from_from_to.covariance.try_inverse() else { continue };
        let kind = match r.provenance {
            Provenance::Sequential => EdgeKind::Sequential,
            _ => EdgeKind::Closure,
        };
        let information = information / seq_inflation;
        let edge =
            Edge::new(r.from.0.into(), r.to.0.into(), r.from_from_to.mean, information, kind);
        let _ = graph.add_edge(edge);
    }
    for o in overlaps {
        let edge =
            Edge::new(o.from.0.into(), o.to.0.into(), o.mean, o.information, EdgeKind::Closure);
        let _ = graph.add_edge(edge);
    }
    let settings = Settings { kernel, max_iterations: 20, relative_tolerance: 1e-4, ..Settings::default() };
    if optimize(&mut graph, &settings).is_ok() {
        for node in graph.nodes() {
            manifold.set_pose(PatchId(node.id as u32), node.pose);
        }
    }
}

/// The global pass: measure how all overlapping patches fit, re-estimate, repeat.
pub(crate) fn refit(
    manifold: &mut Manifold,
    odometry: &[(u32, Pose2, f64, f64)],
    points: &PatchPoints,
    field: FieldSettings,
    matcher: &FastMatcher,
    settings: &RefitSettings,
) {
    for round in 0..settings.rounds {
        let kernel = (settings.kernel_m * 0.6f64.powi(round as i32)).max(0.03);
        let t = std::time::Instant::now();
        let mut overlaps = measure_overlaps(manifold, points, field, matcher, settings, kernel as f32);
        let t1 = t.elapsed();
        for &(k, motion, t, r) in odometry {
            overlaps.push(Overlap { from: PatchId(k - 1), to: PatchId(k), mean: motion, information: Matrix3::from_diagonal(&nalgebra::Vector3::new(t, t, r)) });
        }
        optimise_with(manifold, &overlaps, Kernel::Cauchy { scale: 3.0 }, settings.seq_inflation);
        if std::env::var("V").is_ok() { eprintln!("  round {round}: {} overlaps {:?} opt {:?}", overlaps.len(), t1, t.elapsed()-t1); }
    }
}

fn measure_overlaps(
    manifold: &Manifold,
    points: &PatchPoints,
    field: FieldSettings,
    matcher: &FastMatcher,
    settings: &RefitSettings,
    kernel: f32,
) -> Vec<Overlap> {
    let ids: Vec<PatchId> = manifold.patches().iter().map(|p| p.id).collect();
    ids.par_chunks(32)
        .map_init(
            || SurfelField::new(field, (0.0, 0.0), (0.0, 0.0)),
            |scratch, chunk| {
                let mut out = Vec::new();
                for &from in chunk {
                    overlaps_of(from, manifold, points, scratch, matcher, settings, kernel, &mut out);
                }
                out
            },
        )
        .flatten_iter()
        .collect()
}

#[allow(clippy::too_many_arguments)]
fn overlaps_of(
    from: PatchId,
    manifold: &Manifold,
    points: &PatchPoints,
    scratch: &mut SurfelField,
    matcher: &FastMatcher,
    settings: &RefitSettings,
    kernel: f32,
    out: &mut Vec<Overlap>,
) {
    let own = manifold.patch(from).island_from_patch;
    let mut near: Vec<(f64, PatchId, Pose2)> = manifold
        .patches()
        .iter()
        .filter(|p| p.id != from)
        .filter_map(|p| {
            let d = p.island_from_patch.distance(&own);
            (d <= settings.overlap_distance_m)
                .then(|| (d, p.id, own.between(&p.island_from_patch)))
        })
        .map(|(d, id, pose)| (d + pose.yaw.abs(), id, pose))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    if near.is_empty() {
        return;
    }
    let (min, max) = bounds(&points[from.index()], 0.6);
    scratch.reset(min, max);
    scratch.insert(&points[from.index()], &Pose2::IDENTITY);
    let mut count = 0;
    for (_, to, pose) in near {
        if count >= settings.overlaps_per_patch {
            break;
        }
        let (h, g, share) = matcher.quadratic(scratch, &points[to.index()], &pose, kernel);
        if share < settings.overlap_share {
            continue;
        }
        let h = h / settings.overlap_inflation;
        let g = g / settings.overlap_inflation;
        let damped = h + Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, 1.0));
        let Some(cholesky) = damped.cholesky() else { continue };
        let step = -cholesky.solve(&g);
        count += 1;
        out.push(Overlap { from, to, mean: pose.retract(&step), information: h });
    }
}

fn bounds(points: &[LinePoint], margin: f64) -> ((f64, f64), (f64, f64)) {
    let (mut min, mut max) = ((0.0f64, 0.0f64), (0.0f64, 0.0f64));
    for p in points {
        let (x, y) = (f64::from(p.x), f64::from(p.y));
        min = (min.0.min(x), min.1.min(y));
        max = (max.0.max(x), max.1.max(y));
    }
    ((min.0 - margin, min.1 - margin), (max.0 + margin, max.1 + margin))
}

/// Places every scan in the refitted map.
pub(crate) fn relocalise(
    manifold: &Manifold,
    points: &PatchPoints,
    scans: &mut [ScanPose],
    scan_points: &[Vec<LinePoint>],
    field: FieldSettings,
    matcher: &FastMatcher,
    settings: &RefitSettings,
    odometry: &[Option<Pose2>],
    model: &crate::OdometrySettings,
) {
    let patches = manifold.patches();
    let mut cluster_of = vec![usize::MAX; patches.len()];
    let mut centres = Vec::new();
    for p in patches {
        if cluster_of[p.id.index()] != usize::MAX {
            continue;
        }
        for q in patches {
            if cluster_of[q.id.index()] == usize::MAX
                && q.island_from_patch.distance(&p.island_from_patch) <= settings.cluster_m
            {
                cluster_of[q.id.index()] = centres.len();
            }
        }
        centres.push(p.island_from_patch);
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); centres.len()];
    for (i, scan) in scans.iter().enumerate() {
        members[cluster_of[scan.patch.index()]].push(i);
    }
    let new: Vec<Vec<(usize, Pose2, Matrix3<f64>)>> = members
        .par_iter()
        .enumerate()
        .map_init(
            || SurfelField::new(field, (0.0, 0.0), (0.0, 0.0)),
            |scratch, (c, members)| {
                let centre = centres[c];
                let reach = settings.cluster_m + settings.cluster_reach_m;
                let near: Vec<_> = patches
                    .iter()
                    .filter(|p| p.island_from_patch.distance(&centre) <= reach)
                    .map(|p| (p.id, centre.between(&p.island_from_patch)))
                    .collect();
                let (mut min, mut max) = ((0.0f64, 0.0f64), (0.0f64, 0.0f64));
                for (id, pose) in &near {
                    let moved = points[id.index()].iter().map(|p| {
                        pose.transform(nalgebra::Vector2::new(p.x.into(), p.y.into()))
                    });
                    for t in moved {
                        min = (min.0.min(t.x), min.1.min(t.y));
                        max = (max.0.max(t.x), max.1.max(t.y));
                    }
                }
                scratch.reset((min.0 - 0.6, min.1 - 0.6), (max.0 + 0.6, max.1 + 0.6));
                for (id, pose) in &near {
                    scratch.insert(&points[id.index()], pose);
                }
                members
                    .iter()
                    .filter_map(|&i| {
                        let scan = &scans[i];
                        let pose = manifold.patch(scan.patch).island_from_patch * scan.patch_from_base;
                        let prior = Prior {
                            pose: centre.between(&pose),
                            information: Matrix3::from_diagonal(&(nalgebra::Vector3::new(400.0, 400.0, 2500.0) * settings.reloc_prior)),
                        };
                        let result = matcher.align(scratch, &scan_points[i], &prior);
                        (result.status.is_usable() && result.inlier_ratio > 0.3
                            && prior.pose.distance(&result.pose) < 0.3)
                            .then(|| (i, centre * result.pose, result.covariance.try_inverse().unwrap_or_else(Matrix3::zeros)))
                    })
                    .collect()
            },
        )
        .collect();
    let mut knowledge: Vec<Knowledge> = scans
        .iter()
        .enumerate()
        .map(|(i, s)| {
            let motion = match (i > 0).then(|| (odometry[i - 1], odometry[i])) {
                Some((Some(a), Some(b))) => {
                    let mean = a.between(&b);
                    let (d, t) = (mean.norm(), mean.yaw.abs());
                    let o = model;
                    let st = o.translation_floor_m + o.translation_per_m * d + o.translation_per_rad_m * t;
                    let sr = o.rotation_floor_rad + o.rotation_per_m_rad * d + o.rotation_per_rad * t;
                    Some(GaussianPose2 { mean, covariance: Matrix3::from_diagonal(&nalgebra::Vector3::new(st * st, st * st, sr * sr)) })
                }
                _ => None,
            };
            Knowledge {
                measured: manifold.patch(s.patch).island_from_patch * s.patch_from_base,
                information: Matrix3::from_diagonal(&nalgebra::Vector3::new(100.0, 100.0, 1000.0)),
                motion,
            }
        })
        .collect();
    for (i, pose, information) in new.into_iter().flatten() {
        knowledge[i].measured = pose;
        knowledge[i].information = information / settings.unary_inflation;
    }
    let poses = smooth(&knowledge, 3.0, 3);
    for (scan, pose) in scans.iter_mut().zip(&poses) {
        scan.patch_from_base = manifold.patch(scan.patch).island_from_patch.between(pose);
    }
}

/// Inflated covariance of a match for a relation.
pub(crate) fn relation(mean: Pose2, covariance: Matrix3<f64>) -> GaussianPose2 {
    GaussianPose2 { mean, covariance }
}
