use crate::LinePoint;

/// Points handled side by side: every operation on a block is a loop over this many lanes, which
/// the compiler turns into vector instructions.
pub(crate) const LANES: usize = 8;

pub(crate) type Lanes = [f32; LANES];

/// Points laid out by coordinate, in blocks; the last block is filled up with points of no weight.
#[derive(Clone, Debug, Default)]
pub(crate) struct PointBlocks {
    pub blocks: Vec<Block>,
    /// Number of real points.
    pub len: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
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

/// A block rotated into the field's axes, not yet translated.
pub(crate) struct Turned {
    pub x: Lanes,
    pub y: Lanes,
    pub nx: Lanes,
    pub ny: Lanes,
    pub variance: Lanes,
}

impl Block {
    #[inline(always)]
    /// The block turned by an angle.
    pub fn turned(&self, sin: f32, cos: f32) -> Turned {
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
