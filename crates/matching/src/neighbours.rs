use geometry::Vector2;

/// A static kd-tree over points in the plane, for nearest neighbours within a gate.
///
/// Points with a coordinate that is not finite are never found.
#[derive(Clone, Debug, Default)]
pub struct NeighbourTree {
    /// Points in tree order with their original index.
    points: Vec<Entry>,
    /// Splits in heap order: axis and value.
    splits: Vec<Split>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    x: f32,
    y: f32,
    index: u32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Split {
    along_y: bool,
    value: f32,
}

/// Points in a leaf are compared one by one.
const LEAF: usize = 8;

impl NeighbourTree {
    /// The tree of some points; indices in answers count these points.
    pub fn new(points: impl IntoIterator<Item = Vector2<f64>>) -> Self {
        let mut points: Vec<Entry> = points
            .into_iter()
            .enumerate()
            .map(|(i, p)| Entry { x: p.x as f32, y: p.y as f32, index: i as u32 })
            .filter(|e| e.x.is_finite() && e.y.is_finite())
            .collect();
        let mut splits = Vec::new();
        split(&mut points, 0, &mut splits);
        NeighbourTree { points, splits }
    }

    /// Index and squared distance of the point nearest to `query`, if nearer than the square root
    /// of
    /// `gate_squared`; among equals the one with the lowest index.
    pub fn nearest(&self, query: Vector2<f64>, gate_squared: f64) -> Option<(usize, f64)> {
        let (x, y) = (query.x as f32, query.y as f32);
        if !(x.is_finite() && y.is_finite()) {
            return None;
        }
        let mut search = Search { x, y, best: gate_squared as f32, index: u32::MAX };
        self.visit(0, &self.points, (0.0, 0.0), &mut search);
        (search.index != u32::MAX).then(|| (search.index as usize, f64::from(search.best)))
    }

    /// Calls `visit` with the index of every point at a squared distance of `radius_squared` at
    /// most, in no particular order.
    pub fn within(&self, query: Vector2<f64>, radius_squared: f64, mut visit: impl FnMut(usize)) {
        let (x, y, radius2) = (query.x as f32, query.y as f32, radius_squared as f32);
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        let mut depth;
        // Halving leaves no more open than a tree of 2^32 points is deep.
        let mut open: [(usize, &[Entry]); 34] = [(0, &[]); 34];
        (open[0], depth) = ((0, &self.points[..]), 1);
        while depth > 0 {
            depth -= 1;
            let (node, points) = open[depth];
            if points.len() <= LEAF {
                let near = |e: &&Entry| (e.x - x).powi(2) + (e.y - y).powi(2) <= radius2;
                points.iter().filter(near).for_each(|e| visit(e.index as usize));
                continue;
            }
            let split = self.splits[node];
            let beyond = if split.along_y { y } else { x } - split.value;
            let (left, right) = points.split_at(points.len() / 2);
            let reaches_over = beyond * beyond <= radius2;
            if beyond <= 0.0 || reaches_over {
                open[depth] = (2 * node + 1, left);
                depth += 1;
            }
            if beyond >= 0.0 || reaches_over {
                open[depth] = (2 * node + 2, right);
                depth += 1;
            }
        }
    }

    /// Searches the points below `node`, whose box is `outside` away from the query along each
    /// axis.
    fn visit(&self, node: usize, points: &[Entry], outside: (f32, f32), search: &mut Search) {
        if points.len() <= LEAF {
            for e in points {
                let (dx, dy) = (e.x - search.x, e.y - search.y);
                let d2 = dx * dx + dy * dy;
                if d2 < search.best || (d2 == search.best && e.index < search.index) {
                    search.best = d2;
                    search.index = e.index;
                }
            }
            return;
        }
        let split = self.splits[node];
        let beyond = if split.along_y { search.y } else { search.x } - split.value;
        let (left, right) = points.split_at(points.len() / 2);
        let (left, right) = ((2 * node + 1, left), (2 * node + 2, right));
        let (near, far) = if beyond < 0.0 { (left, right) } else { (right, left) };
        self.visit(near.0, near.1, outside, search);
        let outside = if split.along_y { (outside.0, beyond) } else { (beyond, outside.1) };
        if outside.0 * outside.0 + outside.1 * outside.1 <= search.best {
            self.visit(far.0, far.1, outside, search);
        }
    }
}

/// A query under way.
struct Search {
    x: f32,
    y: f32,
    best: f32,
    index: u32,
}

/// Orders `points` so that the first half lies on one side of the split of `node`, recursively.
fn split(points: &mut [Entry], node: usize, splits: &mut Vec<Split>) {
    if points.len() <= LEAF {
        return;
    }
    let (mut lo, mut hi) = ((f32::MAX, f32::MAX), (f32::MIN, f32::MIN));
    for e in points.iter() {
        lo = (lo.0.min(e.x), lo.1.min(e.y));
        hi = (hi.0.max(e.x), hi.1.max(e.y));
    }
    let along_y = hi.1 - lo.1 > hi.0 - lo.0;
    let middle = points.len() / 2;
    let key = |e: &Entry| if along_y { e.y } else { e.x };
    points.select_nth_unstable_by(middle, |a, b| {
        key(a).total_cmp(&key(b)).then(a.index.cmp(&b.index))
    });
    if splits.len() <= node {
        splits.resize(node + 1, Split::default());
    }
    splits[node] = Split { along_y, value: key(&points[middle]) };
    let (left, right) = points.split_at_mut(middle);
    split(left, 2 * node + 1, splits);
    split(right, 2 * node + 2, splits);
}
