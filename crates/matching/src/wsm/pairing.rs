use super::WsmSettings;
use super::error_model::{SurfaceLine, WeightedPoint};
use crate::NeighbourTree;
use geometry::{Matrix2, Pose2, Vector2};

/// A reference point and a scan point taken for the same piece of surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<'a> {
    pub reference: &'a WeightedPoint,
    pub scan: &'a WeightedPoint,
}

/// A pair at a pose, in the reference frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedPair {
    /// The reference point.
    pub a: Vector2<f64>,
    /// The scan point, moved.
    pub c: Vector2<f64>,
    /// The weight, inverse of the pair's covariance `P`.
    pub weight: Matrix2<f64>,
}

impl Pair<'_> {
    /// The surface both points lie on, in the reference frame: the mean of the two directions,
    /// weighted by how well they are known.
    pub fn surface(&self, r: &Matrix2<f64>) -> Option<SurfaceLine> {
        let scan = self.scan.surface.map(|l| SurfaceLine { normal: r * l.normal, ..l });
        match (self.reference.surface, scan) {
            (Some(a), Some(b)) => {
                let (wa, wb) = (1.0 / a.variance.max(1e-9), 1.0 / b.variance.max(1e-9));
                let normal = (a.normal * wa + b.normal * wb).try_normalize(1e-9)?;
                Some(SurfaceLine { normal, variance: 1.0 / (wa + wb) })
            }
            (line, None) | (None, line) => line,
        }
    }

    /// `P = P^C + P^N_a + R P^N_b R^T` (thesis eq. 4.5; the biases are within `P^N`).
    ///
    /// `P^C` is the correspondence error: along the surface, multiplied by `corr_scale` squared,
    /// and the little across it that comes of an error in the surface's direction; every way, and
    /// not multiplied, where that direction is not known.
    pub fn covariance(&self, r: &Matrix2<f64>, corr_scale: f64, one_sided: bool) -> Matrix2<f64> {
        let (a, b) = (self.reference.spacing_variance, self.scan.spacing_variance);
        // The sparser of two samplings decides how far off a neighbour may be.
        let offset = if one_sided { a.max(b) } else { a + b };
        let noise = self.reference.noise + turned(&self.scan.noise, r.m11, r.m21);
        let correspondence = match self.surface(r) {
            Some(line) => {
                let tangent = Vector2::new(-line.normal.y, line.normal.x);
                let along = tangent * tangent.transpose() * (corr_scale * corr_scale);
                let leak = line.variance * (offset + tangent.dot(&(noise * tangent)));
                along * offset + line.normal * line.normal.transpose() * leak
            }
            None => Matrix2::identity() * offset,
        };
        noise + correspondence
    }

    /// The pair with its weight at a pose; `None` where the covariance cannot be inverted.
    pub fn weighted(
        &self,
        pose: &Pose2,
        extra_variance: f64,
        settings: &WsmSettings,
    ) -> Option<WeightedPair> {
        let (s, c) = pose.yaw.sin_cos();
        let r = Matrix2::new(c, -s, s, c);
        self.weighted_at(&r, pose.translation(), extra_variance, settings)
    }

    /// [`Pair::weighted`] with the rotation matrix made once for many pairs.
    pub fn weighted_at(
        &self,
        r: &Matrix2<f64>,
        p: Vector2<f64>,
        extra_variance: f64,
        settings: &WsmSettings,
    ) -> Option<WeightedPair> {
        let extra = Matrix2::identity() * extra_variance;
        let weight = (self.covariance(r, settings.corr_scale, settings.one_sided) + extra)
            .try_inverse()
            .filter(|w| w.iter().all(|v| v.is_finite()))?;
        let c = r * self.scan.position + p;
        Some(WeightedPair { a: self.reference.position, c, weight })
    }
}

impl WeightedPair {
    /// Squared Mahalanobis distance of the two points.
    pub fn chi_squared(&self) -> f64 {
        let e = self.a - self.c;
        e.dot(&(self.weight * e))
    }
}

/// `R m R^T` of a symmetric matrix and the rotation with cosine `c` and sine `s`.
fn turned(m: &Matrix2<f64>, c: f64, s: f64) -> Matrix2<f64> {
    let (cc, ss, cs) = (c * c, s * s, c * s);
    let xx = cc * m.m11 - 2.0 * cs * m.m12 + ss * m.m22;
    let yy = ss * m.m11 + 2.0 * cs * m.m12 + cc * m.m22;
    let xy = cs * (m.m11 - m.m22) + (cc - ss) * m.m12;
    Matrix2::new(xx, xy, xy, yy)
}

/// Both clouds, ready to be paired.
pub(crate) struct Pairing<'a> {
    reference: &'a [WeightedPoint],
    scan: &'a [WeightedPoint],
    reference_tree: NeighbourTree,
    scan_tree: NeighbourTree,
    /// Each scan point's neighbour of the last call: most often a good bound for the next one.
    last: Vec<Option<usize>>,
    /// Cosine of the largest angle between the normals of a pair.
    normal_cos: f64,
}

impl<'a> Pairing<'a> {
    pub fn new(reference: &'a [WeightedPoint], scan: &'a [WeightedPoint], normal_cos: f64) -> Self {
        Pairing {
            normal_cos,
            reference,
            scan,
            reference_tree: NeighbourTree::new(reference.iter().map(|p| p.smoothed)),
            scan_tree: NeighbourTree::new(scan.iter().map(|p| p.smoothed)),
            last: vec![None; scan.len()],
        }
    }

    /// Number of scan points.
    pub fn scan_len(&self) -> usize {
        self.scan.len()
    }

    /// Pairs of points that are each other's nearest neighbours at a pose, within `gate` metres
    /// (and half a sampling step, where that is more).
    pub fn mutual_pairs(&mut self, pose: &Pose2, gate: f64) -> Vec<Pair<'a>> {
        let (s, c) = pose.yaw.sin_cos();
        let (r, p) = (Matrix2::new(c, -s, s, c), pose.translation());
        let mut pairs = Vec::with_capacity(self.scan.len());
        for (i, scan) in self.scan.iter().enumerate() {
            let moved = r * scan.smoothed + p;
            let gate = gate.max(0.5 * scan.spacing.min(1.0));
            // A little more than distances already known, for rounding.
            let wider = |d2: f64| d2 * 1.0001 + 1e-9;
            let known = self.last[i].map_or(f64::INFINITY, |j| {
                wider((self.reference[j].smoothed - moved).norm_squared())
            });
            let nearest = self.reference_tree.nearest(moved, known.min(gate * gate));
            self.last[i] = nearest.map(|n| n.0).or(self.last[i]);
            let Some((j, d2)) = nearest else { continue };
            let reference = &self.reference[j];
            let back = r.transpose() * (reference.smoothed - p);
            if !surfaces_agree(reference, scan, &r, self.normal_cos) {
                continue;
            }
            if self.scan_tree.nearest(back, wider(d2)).is_none_or(|(k, _)| k == i) {
                pairs.push(Pair { reference, scan });
            }
        }
        pairs
    }
}

/// Whether two points can lie on the same surface, as far as their normals are known.
fn surfaces_agree(
    reference: &WeightedPoint,
    scan: &WeightedPoint,
    r: &Matrix2<f64>,
    normal_cos: f64,
) -> bool {
    match (reference.surface, scan.surface) {
        (Some(a), Some(b)) => a.normal.dot(&(r * b.normal)) >= normal_cos,
        _ => true,
    }
}
