use crate::map::Map;
use manifold::{PatchId, SubmapLimits};
use matching::LinePoint;

const RINGS: usize = 8;
const RING_M: f32 = 1.0;
const HARMONICS: usize = 5;

/// What a place looks like from all round, whatever the robot's heading.
///
/// The surroundings are counted in rings around the place; of each ring's distribution over
/// bearings the magnitudes of the first Fourier coefficients are kept, which a turn of the robot
/// does not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Signature([[f32; HARMONICS]; RINGS]);

impl Signature {
    /// Number of values.
    pub const VALUES: usize = RINGS * HARMONICS;

    /// The values, ring by ring: magnitudes, of unit norm together.
    pub fn values(&self) -> [f32; Self::VALUES] {
        std::array::from_fn(|i| self.0[i / HARMONICS][i % HARMONICS])
    }

    /// Euclidean distance between two signatures, 0 to about 2.
    pub fn distance(&self, other: &Signature) -> f64 {
        let pairs = self.0.iter().flatten().zip(other.0.iter().flatten());
        f64::from(pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt())
    }
}

/// The signature of a patch's local submap.
pub(crate) fn signature_of(patch: PatchId, map: &Map, limits: &SubmapLimits) -> Signature {
    let limits = SubmapLimits { distance_m: 6.0, patches: 16, ..*limits };
    let own = map.pose(patch);
    let mut sums = [[(0.0f32, 0.0f32); HARMONICS]; RINGS];
    for member in map.manifold.local_submap(patch, &limits) {
        let pose = own.between(&map.pose(member.patch));
        for p in map.surface(member.patch).iter().map(LinePoint::mover(&pose)) {
            let range = (p.x * p.x + p.y * p.y).sqrt();
            let ring = (range / RING_M) as usize;
            if ring >= RINGS || range < 0.2 {
                continue;
            }
            let (c, s) = (p.x / range, p.y / range);
            let (mut re, mut im) = (1.0f32, 0.0f32);
            // Points thin out with range: weigh them by it.
            let weight = range;
            for slot in &mut sums[ring] {
                slot.0 += weight * re;
                slot.1 += weight * im;
                (re, im) = (re * c - im * s, re * s + im * c);
            }
        }
    }
    let mut values = [[0.0f32; HARMONICS]; RINGS];
    for (row, sum) in values.iter_mut().zip(&sums) {
        for (value, (re, im)) in row.iter_mut().zip(sum) {
            *value = re.hypot(*im);
        }
    }
    let norm = values.iter().flatten().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    Signature(values.map(|row| row.map(|v| v / norm)))
}
