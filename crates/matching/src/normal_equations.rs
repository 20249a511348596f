use crate::SurfelField;
use crate::point_blocks::{LANES, Lanes, PointBlocks, Turned};
use crate::surfel::{Surfel, UPPER};
use geometry::Pose2;
use pulp::{Simd, WithSimd};

/// Normal equations of one linearisation, in field coordinates `(tx, ty, yaw)`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NormalEquations {
    /// Upper triangle of the information, row by row.
    pub h: [f32; 6],
    /// Gradient of half the weighted squared residuals.
    pub g: [f32; 3],
    /// Sum over points of how well each is explained, in `[0, 1]`.
    pub inliers: f32,
    /// Information that the noise of the normals pretends, 1/m^2.
    pub pretended: f32,
    /// Sum of the weights times the squared distances from the scan's origin: the information about
    /// yaw if all points moved across their surfaces. Where inliers are counted.
    pub lever: f32,
    /// Points with a correspondence.
    pub pairs: u32,
}

/// Sums per lane; added up once at the end, so that lanes do not wait for one another.
#[derive(Clone, Copy, Default)]
struct LaneSums {
    h: [Lanes; 6],
    g: [Lanes; 3],
    inliers: Lanes,
    pretended: Lanes,
    lever: Lanes,
    pairs: Lanes,
}

/// What a pair of point and surfel counts for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairWeights {
    /// Scale of the Geman-McClure kernel that weighs residuals down, metres.
    pub kernel_m: f32,
    /// Scale of the same kernel that judges whether a point is explained, metres.
    pub inlier_m: f32,
    /// Pairs whose normals differ by more than `acos(normal_cos)` are left out.
    pub normal_cos: f32,
}

/// Linearises the weighted point-to-line cost at `pose`: each point against the surfel nearest to
/// it, weighted by both variances and a robust kernel. Inliers are counted only where asked for.
///
/// Compiled for each family of vector instructions and chosen when it runs. Every one of them does
/// the same operations in the same order, so that all give the same bits.
pub(crate) fn linearise<const COUNT_INLIERS: bool>(
    field: &SurfelField,
    points: &PointBlocks,
    pose: &Pose2,
    weights: &PairWeights,
) -> NormalEquations {
    pulp::Arch::new().dispatch(Linearisation::<COUNT_INLIERS> { field, points, pose, weights })
}

/// The arguments of [`linearise`], for the choice of instructions.
struct Linearisation<'a, const COUNT_INLIERS: bool> {
    field: &'a SurfelField,
    points: &'a PointBlocks,
    pose: &'a Pose2,
    weights: &'a PairWeights,
}

impl<const COUNT_INLIERS: bool> WithSimd for Linearisation<'_, COUNT_INLIERS> {
    type Output = NormalEquations;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> NormalEquations {
        let (sin, cos) = self.pose.yaw.sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let (tx, ty) = (self.pose.x as f32, self.pose.y as f32);
        let (field, weights) = (self.field.look_up(tx, ty), *self.weights);
        let mut sums = LaneSums::default();
        for block in &self.points.blocks {
            let turned = block.turned(sin, cos);
            let surfels = SurfelLanes::of(&field.nearest(&turned));
            sums.add::<COUNT_INLIERS>(&turned, &surfels, (tx, ty), &weights);
        }
        sums.total()
    }
}

/// Surfels by component.
struct SurfelLanes {
    nx: Lanes,
    ny: Lanes,
    offset: Lanes,
    variance: Lanes,
    normal_variance: Lanes,
}

impl SurfelLanes {
    #[inline(always)]
    fn of(surfels: &[Surfel; LANES]) -> Self {
        let mut lanes = SurfelLanes {
            nx: [0.0; LANES],
            ny: [0.0; LANES],
            offset: [0.0; LANES],
            variance: [0.0; LANES],
            normal_variance: [0.0; LANES],
        };
        for (k, surfel) in surfels.iter().enumerate() {
            let Surfel { normal, line } = *surfel;
            let doubt = (line >> 32) as u32;
            lanes.nx[k] = f32::from_bits(normal as u32);
            lanes.ny[k] = f32::from_bits((normal >> 32) as u32);
            lanes.offset[k] = f32::from_bits(line as u32);
            lanes.variance[k] = f32::from_bits(doubt & UPPER);
            lanes.normal_variance[k] = f32::from_bits(doubt << 16);
        }
        lanes
    }
}

impl LaneSums {
    #[inline(always)]
    fn add<const COUNT_INLIERS: bool>(
        &mut self,
        p: &Turned,
        s: &SurfelLanes,
        (tx, ty): (f32, f32),
        weights: &PairWeights,
    ) {
        let kernel2 = weights.kernel_m * weights.kernel_m;
        let inlier2 = weights.inlier_m * weights.inlier_m;
        for k in 0..LANES {
            let (nx, ny) = (s.nx[k], s.ny[k]);
            let r = nx * (p.x[k] + tx) + ny * (p.y[k] + ty) - s.offset[k];
            let alike = p.nx[k] * nx + p.ny[k] * ny >= weights.normal_cos;
            let used = if alike { 1.0 } else { 0.0 };
            // (kernel^2 / (kernel^2 + r^2))^2 / variance, with one division for both.
            let doubt = kernel2 + r * r;
            let numerator = if alike { kernel2 * kernel2 } else { 0.0 };
            let w = numerator / (doubt * doubt * (s.variance[k] + p.variance[k]));
            let (jx, jy, jw) = (nx, ny, ny * p.x[k] - nx * p.y[k]);
            let (wx, wy, ww) = (w * jx, w * jy, w * jw);
            self.h[0][k] += wx * jx;
            self.h[1][k] += wx * jy;
            self.h[2][k] += wx * jw;
            self.h[3][k] += wy * jy;
            self.h[4][k] += wy * jw;
            self.h[5][k] += ww * jw;
            self.g[0][k] += wx * r;
            self.g[1][k] += wy * r;
            self.g[2][k] += ww * r;
            if COUNT_INLIERS {
                let explained = inlier2 / (inlier2 + r * r);
                self.inliers[k] += used * explained * explained;
                self.lever[k] += w * (p.x[k] * p.x[k] + p.y[k] * p.y[k]);
            }
            self.pretended[k] += w * s.normal_variance[k];
            self.pairs[k] += used;
        }
    }

    fn total(&self) -> NormalEquations {
        let sum = |lanes: &Lanes| lanes.iter().sum::<f32>();
        NormalEquations {
            h: self.h.each_ref().map(sum),
            g: self.g.each_ref().map(sum),
            inliers: sum(&self.inliers),
            pretended: sum(&self.pretended),
            lever: sum(&self.lever),
            pairs: sum(&self.pairs) as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FieldSettings, LinePoint};

    /// A bent wall with ripples, seen from the origin.
    fn wall(count: usize, phase: f32) -> Vec<LinePoint> {
        let point = |k: usize| {
            let angle = -1.5 + 3.0 * k as f32 / count as f32;
            let range = 4.0 + angle.sin() + 0.01 * (37.0 * angle + phase).sin();
            let (nx, ny) = ((angle + 0.2).cos(), (angle + 0.2).sin());
            LinePoint {
                x: range * angle.cos(),
                y: range * angle.sin(),
                nx: -nx,
                ny: -ny,
                variance: 1e-4 * (1.5 + angle.cos()),
                normal_variance: 1e-3,
            }
        };
        (0..count).map(point).collect()
    }

    /// Vector instructions and plain ones: the same bits, whatever the pose and the number of
    /// points.
    #[test]
    fn all_instruction_sets_give_the_same_bits() {
        let mut field = SurfelField::new(FieldSettings::default(), (-2.0, -6.0), (6.0, 6.0));
        field.insert(&wall(900, 0.0), &Pose2::IDENTITY);
        let weights = PairWeights { kernel_m: 0.1, inlier_m: 0.07, normal_cos: 0.7 };
        for count in [1, 7, 8, 9, 100, 361] {
            let points = PointBlocks::new(wall(count, 1.0).iter());
            for k in 0..40 {
                let shift = 0.02 * f64::from(k);
                let pose = Pose2::new(shift - 0.4, 0.3 - shift, 0.03 * f64::from(k) - 0.6);
                let (field, points, pose, weights) = (&field, &points, &pose, &weights);
                let plain =
                    Linearisation::<true> { field, points, pose, weights }.with_simd(pulp::Scalar);
                let chosen = linearise::<true>(field, points, pose, weights);
                let bits = |n: &NormalEquations| {
                    let sums = [n.inliers, n.pretended, n.lever, n.pairs as f32];
                    n.h.iter().chain(&n.g).chain(&sums).map(|v| v.to_bits()).collect::<Vec<_>>()
                };
                assert_eq!(bits(&plain), bits(&chosen), "{count} points, pose {k}");
                assert!(count < 100 || plain.pairs > 0);
            }
        }
    }
}
