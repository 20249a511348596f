/// Normals are never taken for worse than this (18 degrees), rad^2.
const LARGEST_NORMAL_VARIANCE: f32 = 0.1;

/// The tangent line of a small piece of surface, as the matcher reads it: two words, so that a
/// block of them is gathered by few loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Surfel {
    /// Unit normal, towards the side it was seen from: `nx` in the lower half, `ny` in the upper.
    pub normal: u64,
    /// The line is `nx x + ny y = offset`: the offset in the lower half; in the upper half the
    /// variances of position and direction, 16 bits each.
    pub line: u64,
}

impl Surfel {
    /// Stands for "no surfel in reach": agrees with no normal.
    pub const ABSENT: Surfel = Surfel { normal: 0, line: (f32::to_bits(1.0) as u64) << 32 };

    /// `variance` of the line's position along its normal, m^2, and `normal_variance` of the
    /// normal's direction, rad^2, are kept to 8 bits.
    pub fn new((nx, ny): (f32, f32), offset: f32, variance: f32, normal_variance: f32) -> Self {
        let rounded = |v: f32| v.to_bits() + 0x8000;
        let doubt = (rounded(variance) & UPPER) | (rounded(normal_variance) >> 16);
        Surfel { normal: pack(nx.to_bits(), ny.to_bits()), line: pack(offset.to_bits(), doubt) }
    }

    /// The unit normal.
    pub fn normal(&self) -> (f32, f32) {
        (f32::from_bits(self.normal as u32), f32::from_bits((self.normal >> 32) as u32))
    }
}

fn pack(lower: u32, upper: u32) -> u64 {
    u64::from(lower) | u64::from(upper) << 32
}

/// Where the first of two packed numbers is.
pub(crate) const UPPER: u32 = 0xffff_0000;

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
        Surfel::new(
            (nx, ny),
            (nx * self.x + ny * self.y) * inverse,
            inverse + roughness_m * roughness_m,
            (1.0 / self.normal_weight).min(LARGEST_NORMAL_VARIANCE),
        )
    }
}
