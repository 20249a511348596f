use crate::search::{Node, Search};
use crate::{
    Candidate, LikelihoodPyramid, MatchResult, Matcher, PointCloud, Prior, SearchSettings,
    SearchWindow, WideSettings,
};
use geometry::Vector2;

/// Olson's correlative matcher ("Real-time correlative scan matching", ICRA 2009), then refinement
/// by the Weighted Scan Matcher.
///
/// Two tables: every yaw and every coarse cell is bounded with the low-resolution one; cells are
/// then searched at full resolution, best bound first, until no bound is better than the best pose.
/// The same optimum as branch and bound, with two levels instead of many.
#[derive(Clone, Copy, Debug, Default)]
pub struct CorrelativeMatcher {
    /// The settings.
    pub settings: WideSettings,
}

impl Matcher for CorrelativeMatcher {
    fn name(&self) -> &'static str {
        "correlative"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        self.settings.align(reference, scan, prior, |pyramid, points, window| {
            pyramid.search_two_levels(points, window, self.settings.min_score).into_iter().collect()
        })
    }
}

/// The coarse table's cells are `2^3 = 8` fine cells wide, 40 cm at the default resolution; Olson
/// uses 10 times.
const COARSE_LEVEL: u8 = 3;

impl LikelihoodPyramid {
    /// The best grid pose in a window by Olson's two-level search, if it scores at least
    /// `min_score`.
    pub fn search_two_levels(
        &self,
        points: &[Vector2<f32>],
        window: &SearchWindow,
        min_score: f32,
    ) -> Option<Candidate> {
        let settings = SearchSettings { min_score, ..SearchSettings::default() };
        let mut search = Search::new(self, points, window, &settings)?;
        let (mut best, mut floor) = (None, search.floor);
        for coarse in coarse_nodes(&mut search) {
            if coarse.sum <= floor {
                break;
            }
            for i in 0..1 << (2 * COARSE_LEVEL) {
                let (dx, dy) = (coarse.dx + (i & 7), coarse.dy + (i >> COARSE_LEVEL));
                if dx > search.reach.0 || dy > search.reach.1 {
                    continue;
                }
                let fine = Node { sum: 0, level: 0, dx, dy, ..coarse };
                if let Some(sum) = search.projections.bound(&fine, floor).filter(|&s| s > floor) {
                    (floor, best) = (sum, Some(Node { sum, ..fine }));
                }
            }
        }
        best.map(|node| search.candidate(&node))
    }
}

/// Every yaw and coarse cell that may hold a good enough pose, best bound first.
fn coarse_nodes(search: &mut Search<'_>) -> Vec<Node> {
    let (floor, reach) = (search.floor, search.reach);
    let mut nodes = Vec::new();
    for yaw in 0..search.projections.steps().count() {
        for dy in (-reach.1..=reach.1).step_by(1 << COARSE_LEVEL) {
            for dx in (-reach.0..=reach.0).step_by(1 << COARSE_LEVEL) {
                let mut node = Node { sum: 0, level: COARSE_LEVEL, yaw_level: 0, yaw, dx, dy };
                if let Some(sum) = search.projections.bound(&node, floor) {
                    node.sum = sum;
                    nodes.push(node);
                }
            }
        }
    }
    nodes.sort_by(|a, b| b.cmp(a));
    nodes
}
