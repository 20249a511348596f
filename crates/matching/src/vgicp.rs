use crate::closest::{
    ClosestPair, ClosestPoints, ClosestSettings, NearestPoint, PairWeight, RangeErrors,
};
use crate::{CloudPoint, GicpMatcher, MatchResult, Matcher, PointCloud, Prior};
use geometry::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Settings of [`VgicpMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VgicpSettings {
    /// What all matchers of closest points share.
    pub closest: ClosestSettings,
    /// Side of a voxel, metres.
    pub voxel_m: f64,
    /// Surfaces of one voxel whose normals differ by more than the angle of this cosine are
    /// averaged apart: the mean over a corner lies on neither wall.
    pub surface_cos: f64,
    /// Fewer points of a surface than this in a voxel are no mean to compare with; all are used
    /// where that leaves too few to match.
    pub min_points: usize,
    /// Variance of a point across its surface, as a share of that along it.
    pub flatness: f64,
}

impl Default for VgicpSettings {
    fn default() -> Self {
        let closest = ClosestSettings {
            // A point may lie anywhere in its voxel.
            gate_end_m: 0.3,
            normal_cos: 0.5,
            // Means have few outliers, and what sees along a corridor looks like one for long.
            keep: 0.97,
            ..ClosestSettings::default()
        };
        let (voxel_m, surface_cos, min_points) = (0.4, 0.7, 3);
        VgicpSettings { closest, voxel_m, surface_cos, min_points, flatness: 1e-3 }
    }
}

/// Voxelised GICP in the plane (Koide, Yokozuka, Oishi, Banno, "Voxelized GICP for fast and
/// accurate 3D point cloud registration", ICRA 2021): the reference's points are averaged in
/// voxels, each surface of a voxel by itself, and each scan point is compared with a mean and its
/// mean covariance.
///
/// The voxel is that of the nearest mean, not the one the point falls into: a pose next to a
/// voxel's border does not change its pairs by moving over it.
#[derive(Clone, Copy, Debug, Default)]
pub struct VgicpMatcher {
    /// The settings.
    pub settings: VgicpSettings,
}

/// The reference's voxels: a point each, and the mean covariance of what it stands for.
struct Voxels {
    cloud: PointCloud,
    shapes: Vec<Matrix2<f64>>,
    flatness: f64,
}

#[derive(Default)]
struct Sum {
    count: f64,
    position: Vector2<f64>,
    ray: Vector2<f64>,
    range: f64,
    normal: Vector2<f64>,
    normal_information: f64,
    shape: Matrix2<f64>,
}

impl Voxels {
    fn new(reference: &PointCloud, settings: &VgicpSettings) -> Self {
        let side = settings.voxel_m.max(1e-3);
        let mut voxels: BTreeMap<(i64, i64), Vec<Sum>> = BTreeMap::new();
        for point in &reference.in_order().points {
            let p = point.position / side;
            if !(p.x.abs() < 1e9 && p.y.abs() < 1e9) {
                continue;
            }
            let voxel = voxels.entry((p.x.floor() as i64, p.y.floor() as i64)).or_default();
            let surface = voxel.iter().position(|s| s.continues(point, settings.surface_cos));
            let surface = surface.unwrap_or_else(|| {
                voxel.push(Sum::default());
                voxel.len() - 1
            });
            voxel[surface].add(point, settings.flatness);
        }
        let mut sums: Vec<Sum> = voxels.into_values().flatten().collect();
        let many = |sum: &Sum| sum.count >= settings.min_points as f64;
        if sums.iter().filter(|sum| many(sum)).count() >= settings.closest.min_pairs {
            sums.retain(many);
        }
        let points = sums.iter().map(Sum::point).collect();
        let shapes = sums.iter().map(|sum| sum.shape / sum.count).collect();
        Voxels { cloud: PointCloud { points }, shapes, flatness: settings.flatness }
    }
}

impl Sum {
    /// Whether a point can lie on the same surface.
    fn continues(&self, point: &CloudPoint, surface_cos: f64) -> bool {
        match (self.normal.try_normalize(1e-9), point.normal) {
            (Some(a), Some(b)) => a.dot(&b) > surface_cos,
            (None, None) => true,
            _ => false,
        }
    }

    fn add(&mut self, point: &CloudPoint, flatness: f64) {
        self.count += 1.0;
        self.position += point.position;
        self.ray += point.ray;
        self.range += point.range;
        self.shape += GicpMatcher::shape(point, flatness);
        if let Some(normal) = point.normal {
            let information = 1.0 / point.normal_variance.max(1e-6);
            self.normal += normal * information;
            self.normal_information += information;
        }
    }

    /// The voxel as a point: its ray is as much shorter as the mean's error is smaller.
    fn point(&self) -> CloudPoint {
        CloudPoint {
            position: self.position / self.count,
            ray: self.ray / self.count.powf(1.5),
            range: self.range / self.count,
            normal: self.normal.try_normalize(1e-9),
            normal_variance: 1.0 / self.normal_information.max(1e-9),
            line_distance: 0.0,
            beam_step: 0.0,
            beam: 0,
        }
    }
}

impl PairWeight for Voxels {
    fn of(&self, pair: &ClosestPair, rotation: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        let scan = GicpMatcher::shape(&pair.scan, self.flatness);
        let moved = rotation * scan * rotation.transpose();
        (self.shapes[pair.reference_index] + moved).try_inverse()
    }
}

impl Matcher for VgicpMatcher {
    fn name(&self) -> &'static str {
        "vgicp"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let voxels = Voxels::new(reference, &self.settings);
        let closest = &self.settings.closest;
        let errors = RangeErrors { range_std_m: closest.range_std_m };
        let correspondence = &NearestPoint::of(&voxels.cloud);
        ClosestPoints {
            settings: closest,
            correspondence,
            weight: &voxels,
            scan,
            locked_turn_rad: 0.0,
        }
        .align(prior, |here, pose| errors.covariance(here, pose))
    }
}
