use std::cmp::{Ordering, Reverse};

/// A set of grid poses: `2^level` cells from `(dx, dy)` on, `2^yaw_level` yaws from
/// `yaw << yaw_level` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Node {
    /// Upper bound of the sum of the points' values, exact for a single pose.
    pub sum: u32,
    pub level: u8,
    pub yaw_level: u8,
    pub yaw: u32,
    pub dx: i32,
    pub dy: i32,
}

impl Ord for Node {
    /// By bound; among equals the finer one first; then in a fixed order, so that ties are broken
    /// the same way always.
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |n: &Node| {
            (n.sum, Reverse((n.level, n.yaw_level, n.yaw, n.dy.abs() + n.dx.abs(), n.dy, n.dx)))
        };
        key(self).cmp(&key(other))
    }
}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
