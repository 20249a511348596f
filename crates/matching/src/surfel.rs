/// Normals are never taken for worse than this (18 degrees), rad^2.
const LARGEST_NORMAL_VARIANCE: f32 = 0.1;

/// The tangent line of a small piece of surface, as the matcher reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Surfel {
    /// Unit normal, towards the side it was seen from.
    pub nx: f32,
    pub ny: f32,
    /// The line is `nx x + ny y = offset`.
    pub offset: f32,
    /// Variance of the line's position along its normal, m^2.
    pub variance: f32,
    /// Variance of the normal's direction, rad^2.
    pub normal_variance: f32,
}

impl Surfel {
    /// Stands for "no surfel in reach": agrees with no normal.
    pub const ABSENT: Surfel =
        Surfel { nx: 0.0, ny: 0.0, offset: 0.0, variance: 1.0, normal_variance: 0.0 };
}

/// Sums over the points of one surfel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moments {
    pub weight: f32,
    pub x: f32,
    pub y: f32,
    pub nx: f32,
    pub ny: f32,
    pub normal_weight: f32,
}

impl Moments {
    /// The line through the points' mean.
    pub fn line(&self, roughness_m: f32) -> Surfel {
        let inverse = 1.0 / self.weight;
        let norm = 1.0 / (self.nx * self.nx + self.ny * self.ny).sqrt().max(1e-12);
        let (nx, ny) = (self.nx * norm, self.ny * norm);
        Surfel {
            nx,
            ny,
            offset: (nx * self.x + ny * self.y) * inverse,
            variance: inverse + roughness_m * roughness_m,
            normal_variance: (1.0 / self.normal_weight).min(LARGEST_NORMAL_VARIANCE),
        }
    }
}
