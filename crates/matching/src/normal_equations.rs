use crate::surfel::Surfel;
use crate::{LinePoint, SurfelField};
use geometry::Pose2;

/// Points handled side by side: every operation on a block is a loop over this many lanes, which
/// the compiler turns into vector instructions.
pub(crate) const LANES: usize = 8;

type Lanes = [f32; LANES];

/// Points laid out by coordinate, in blocks; the last block is filled up with points of no weight.
#[derive(Clone, Debug, Default)]
pub(crate) struct PointBlocks {
    blocks: Vec<Block>,
    /// Number of real points.
    pub len: usize,
}

#[derive(Clone, Copy, Debug)]
struct Block {
    x: Lanes,
    y: Lanes,
    nx: Lanes,
    ny: Lanes,
    variance: Lanes,
}

impl PointBlocks {
    pub fn new<'a>(points: impl Iterator<Item = &'a LinePoint>) -> Self {
        let nothing = [0.0; LANES];
        let empty = Block {
            x: nothing,
            y: nothing,
            nx: nothing,
            ny: nothing,
            variance: [f32::INFINITY; LANES],
        };
        let mut result = PointBlocks::default();
        for p in points {
            let lane = result.len % LANES;
            if lane == 0 {
                result.blocks.push(empty);
            }
            if let Some(block) = result.blocks.last_mut() {
                block.x[lane] = p.x;
                block.y[lane] = p.y;
                block.nx[lane] = p.nx;
                block.ny[lane] = p.ny;
                block.variance[lane] = p.variance;
            }
            result.len += 1;
        }
        result
    }
}

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
/// it, weighted by both variances and a robust kernel.
pub(crate) fn linearise(
    field: &SurfelField,
    points: &PointBlocks,
    pose: &Pose2,
    weights: &PairWeights,
) -> NormalEquations {
    let (sin, cos) = pose.yaw.sin_cos();
    let (sin, cos) = (sin as f32, cos as f32);
    let (tx, ty) = (pose.x as f32, pose.y as f32);
    let mut sums = LaneSums::default();
    for block in &points.blocks {
        let turned = block.turned(sin, cos);
        let mut surfels = [Surfel::ABSENT; LANES];
        field.nearest_of(&turned, tx, ty, &mut surfels);
        sums.add(&turned, &surfels, (tx, ty), weights);
    }
    sums.total()
}

/// A block rotated into the field's axes, not yet translated.
pub(crate) struct Turned {
    pub x: Lanes,
    pub y: Lanes,
    pub nx: Lanes,
    pub ny: Lanes,
    variance: Lanes,
}

impl Block {
    #[inline]
    fn turned(&self, sin: f32, cos: f32) -> Turned {
        let mut t = Turned {
            x: [0.0; LANES],
            y: [0.0; LANES],
            nx: [0.0; LANES],
            ny: [0.0; LANES],
            variance: self.variance,
        };
        for k in 0..LANES {
            t.x[k] = cos * self.x[k] - sin * self.y[k];
            t.y[k] = sin * self.x[k] + cos * self.y[k];
            t.nx[k] = cos * self.nx[k] - sin * self.ny[k];
            t.ny[k] = sin * self.nx[k] + cos * self.ny[k];
        }
        t
    }
}

impl LaneSums {
    #[inline]
    fn add(
        &mut self,
        p: &Turned,
        surfels: &[Surfel; LANES],
        (tx, ty): (f32, f32),
        weights: &PairWeights,
    ) {
        let kernel2 = weights.kernel_m * weights.kernel_m;
        let inlier2 = weights.inlier_m * weights.inlier_m;
        for (k, s) in surfels.iter().enumerate() {
            let r = s.nx * (p.x[k] + tx) + s.ny * (p.y[k] + ty) - s.offset;
            let alike = p.nx[k] * s.nx + p.ny[k] * s.ny >= weights.normal_cos;
            let used = if alike { 1.0 } else { 0.0 };
            let ratio = kernel2 / (kernel2 + r * r);
            let robust = used * ratio * ratio;
            let w = robust / (s.variance + p.variance[k]);
            let (jx, jy, jw) = (s.nx, s.ny, s.ny * p.x[k] - s.nx * p.y[k]);
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
            let explained = inlier2 / (inlier2 + r * r);
            self.inliers[k] += used * explained * explained;
            self.pretended[k] += w * s.normal_variance;
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
            pairs: sum(&self.pairs) as u32,
        }
    }
}
