mod node;

use crate::LikelihoodPyramid;
use crate::projection::{Projections, YawSteps};
use geometry::{Pose2, Vector2};
pub(crate) use node::Node;
use serde::{Deserialize, Serialize};
use std::collections::BinaryHeap;

/// Where a search looks: a box of poses around a centre, in the reference frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchWindow {
    /// `reference_from_scan` at the middle of the box.
    pub centre: Pose2,
    /// Half the width along the reference's x axis, metres.
    pub half_x_m: f64,
    /// Half the width along the reference's y axis, metres.
    pub half_y_m: f64,
    /// Half the range of yaw, radians; pi or more means any yaw.
    pub half_yaw_rad: f64,
}

impl SearchWindow {
    /// The level of a [`LikelihoodPyramid`] with cells of this side that is coarse enough for the
    /// window.
    pub(crate) fn levels(&self, cell_m: f64) -> u8 {
        let cells = 2.0 * self.half_x_m.max(self.half_y_m) / cell_m + 1.0;
        let coarsest = cells.clamp(1.0, 1e9).log2().ceil() as usize + 1;
        coarsest.min(LikelihoodPyramid::TOP_LEVEL) as u8
    }
}

/// A pose found by a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// `reference_from_scan`, a grid pose of the search: not refined.
    pub pose: Pose2,
    /// Mean likelihood of the scan's points there, 0 to 1.
    pub score: f32,
}

/// What a search should find, and when it should give up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSettings {
    /// Poses that score less are not looked for.
    pub min_score: f32,
    /// How many distinct candidates are wanted.
    pub candidates: usize,
    /// Poses that score less than the best by more than this are not looked for.
    pub below_best: f32,
    /// Two candidates are distinct when they are farther apart than this, metres ...
    pub separation_m: f64,
    /// ... or turned by more than this, radians.
    pub separation_rad: f64,
    /// Windows to examine before the search gives up and says so.
    pub max_windows: usize,
}

impl Default for SearchSettings {
    fn default() -> Self {
        SearchSettings {
            min_score: 0.4,
            candidates: 1,
            below_best: 1.0,
            separation_m: 0.5,
            separation_rad: 0.3,
            max_windows: 1_000_000,
        }
    }
}

/// What a search found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchOutcome {
    /// The best candidates, best first.
    pub candidates: Vec<Candidate>,
    /// Windows examined.
    pub windows: usize,
    /// False when `max_windows` ended the search: better candidates may exist.
    pub complete: bool,
}

impl LikelihoodPyramid {
    /// The best grid pose in a window, if it scores at least `min_score`: exactly the optimum that
    /// [`LikelihoodPyramid::search_exhaustively`] finds, up to ties.
    pub fn search(
        &self,
        points: &[Vector2<f32>],
        window: &SearchWindow,
        min_score: f32,
    ) -> Option<Candidate> {
        let settings = SearchSettings { min_score, ..SearchSettings::default() };
        self.search_many(points, window, &settings).candidates.first().copied()
    }

    /// The best grid pose, then the best one distinct from it, and so on.
    ///
    /// Best-first branch and bound over windows of `2^h x 2^h` cells and, at coarse levels, `2^h`
    /// steps of yaw; a window's bound is the mean of the pyramid's window maxima (Hess et al. 2016,
    /// there depth-first and with single yaws).
    pub fn search_many(
        &self,
        points: &[Vector2<f32>],
        window: &SearchWindow,
        settings: &SearchSettings,
    ) -> SearchOutcome {
        if settings.candidates == 0 {
            return SearchOutcome { complete: true, ..SearchOutcome::default() };
        }
        match Search::new(self, points, window, settings) {
            Some(search) => search.run(),
            None => SearchOutcome { complete: true, ..SearchOutcome::default() },
        }
    }

    /// The best of all grid poses in a window, one by one: the oracle for the fast searches.
    pub fn search_exhaustively(
        &self,
        points: &[Vector2<f32>],
        window: &SearchWindow,
    ) -> Option<Candidate> {
        let settings = SearchSettings { min_score: 0.0, ..SearchSettings::default() };
        let mut search = Search::new(self, points, window, &settings)?;
        let mut best: Option<Node> = None;
        for yaw in 0..search.projections.steps().count() {
            for dy in -search.reach.1..=search.reach.1 {
                for dx in -search.reach.0..=search.reach.0 {
                    let mut node = Node { sum: 0, level: 0, yaw_level: 0, yaw, dx, dy };
                    node.sum = search.projections.bound(&node, 0).unwrap_or(0);
                    best = best.max(Some(node));
                }
            }
        }
        best.map(|node| search.candidate(&node))
    }
}

/// Below this level, windows hold a single yaw.
///
/// A window of `2^h` yaws needs the table one level up, so it bounds as loosely as one of `2^(h +
/// 1)` cells with a single yaw while there are `2^h / 4` times fewer of them: worth it from `h = 3`
/// on.
const MERGE_LEVEL: u8 = 3;

/// The floor above which sums of at least `lowest` lie.
fn floor_below(lowest: f64) -> u32 {
    ((lowest - 1e-6).ceil() as u32).saturating_sub(1)
}

pub(crate) struct Search<'a> {
    pub projections: Projections<'a>,
    settings: &'a SearchSettings,
    window: &'a SearchWindow,
    cell: f64,
    points: usize,
    /// Level of the coarsest windows: with several yaws they need the table above theirs.
    coarsest: u8,
    /// Cells from the centre to the window's edges.
    pub reach: (i32, i32),
    /// Windows whose bound is not above this are dropped.
    pub floor: u32,
    heap: BinaryHeap<Node>,
    windows: usize,
}

impl<'a> Search<'a> {
    /// More cells than this to a side are not searched; a window this size has 10^8 cells.
    const MAX_REACH: f64 = 5000.0;

    /// `None` when there is nothing to search.
    pub fn new(
        pyramid: &'a LikelihoodPyramid,
        points: &[Vector2<f32>],
        window: &'a SearchWindow,
        settings: &'a SearchSettings,
    ) -> Option<Self> {
        use geometry::LieGroup;
        let cell = pyramid.cell_m();
        if points.is_empty() || !window.centre.is_finite() {
            return None;
        }
        let reach = |half: f64| (half.max(0.0) / cell + 1e-9).min(Self::MAX_REACH) as i32;
        let steps = YawSteps::new(points, window, cell);
        let lowest = f64::from(settings.min_score.max(0.0)) * 255.0 * points.len() as f64;
        Some(Search {
            projections: Projections::new(pyramid, points, &window.centre, steps),
            settings,
            window,
            cell,
            points: points.len(),
            coarsest: pyramid.top_level().saturating_sub(1) as u8,
            reach: (reach(window.half_x_m), reach(window.half_y_m)),
            floor: floor_below(lowest),
            heap: BinaryHeap::new(),
            windows: 0,
        })
    }

    fn run(mut self) -> SearchOutcome {
        let mut complete = self.push_roots();
        self.dive();
        let mut found: Vec<Candidate> = Vec::new();
        while let Some(node) = self.heap.pop().filter(|node| node.sum > self.floor) {
            if self.is_taken(&node, &found) {
                continue;
            }
            if node.level == 0 && node.yaw_level == 0 {
                let candidate = self.candidate(&node);
                found.push(candidate);
                self.raise_floor(candidate.score - self.settings.below_best);
                if found.len() == self.settings.candidates {
                    break;
                }
            } else if self.windows >= self.settings.max_windows {
                complete = false;
            } else {
                for child in self.children(&node).into_iter().flatten() {
                    self.push(child);
                }
            }
        }
        SearchOutcome { candidates: found, windows: self.windows, complete }
    }

    /// Examines a window and keeps it if it may hold a good enough pose.
    fn push(&mut self, mut node: Node) {
        self.windows += 1;
        if let Some(sum) = self.projections.bound(&node, self.floor) {
            node.sum = sum;
            self.heap.push(node);
        }
    }

    /// Drops windows that cannot hold a pose of this score; called with falling scores, of which
    /// the first is the highest.
    fn raise_floor(&mut self, score: f32) {
        let lowest = f64::from(score.max(0.0)) * 255.0 * self.points as f64;
        self.floor = self.floor.max(floor_below(lowest));
    }

    /// Goes straight down from the most promising window to one pose, and lets its score prune.
    fn dive(&mut self) {
        let Some(&top) = self.heap.peek() else { return };
        let mut node = top;
        while node.level > 0 || node.yaw_level > 0 {
            let best = self
                .children(&node)
                .into_iter()
                .flatten()
                .filter_map(|mut child| {
                    child.sum = self.projections.bound(&child, self.floor)?;
                    Some(child)
                })
                .max();
            let Some(best) = best else { return };
            node = best;
        }
        // Poses that score as much must stay reachable, and as many as are wanted below them.
        let wanted = match self.settings.candidates {
            1 => 0,
            _ => (self.settings.below_best.clamp(0.0, 1.0) * 255.0 * self.points as f32) as u32,
        };
        self.floor = self.floor.max(node.sum.saturating_sub(wanted + 1));
    }

    /// Examines the coarsest windows, which together cover the search window once; false if there
    /// are too many.
    fn push_roots(&mut self) -> bool {
        let widest = (2 * self.reach.0.max(self.reach.1) + 1) as u32;
        let level = (widest.next_power_of_two().trailing_zeros() as u8).min(self.coarsest);
        let yaw_level = if level >= MERGE_LEVEL { level } else { 0 };
        for yaw in 0..self.projections.steps().count().div_ceil(1 << yaw_level) {
            for dy in (-self.reach.1..=self.reach.1).step_by(1 << level) {
                for dx in (-self.reach.0..=self.reach.0).step_by(1 << level) {
                    if self.windows >= self.settings.max_windows {
                        return false;
                    }
                    self.push(Node { sum: 0, level, yaw_level, yaw, dx, dy });
                }
            }
        }
        true
    }

    /// The windows a window consists of: halves of each side and of the yaws above the merge level,
    /// single yaws at it, halves of the sides below.
    fn children(&self, node: &Node) -> [Option<Node>; 8] {
        let mut children = [None; 8];
        let yaws = self.projections.steps().count();
        if node.yaw_level == MERGE_LEVEL {
            let first = node.yaw << MERGE_LEVEL;
            for (child, yaw) in children.iter_mut().zip(first..yaws) {
                *child = Some(Node { yaw_level: 0, yaw, ..*node });
            }
            return children;
        }
        let level = node.level - 1;
        let yaw_level = node.yaw_level.saturating_sub(1);
        let halves = if node.yaw_level > 0 { 2 } else { 1 };
        for (i, child) in children.iter_mut().take(4 * halves).enumerate() {
            let i = i as i32;
            let (dx, dy) = (node.dx + ((i & 1) << level), node.dy + ((i >> 1 & 1) << level));
            let yaw = node.yaw * halves as u32 + (i >> 2) as u32;
            if dx <= self.reach.0 && dy <= self.reach.1 && (yaw << yaw_level) < yaws {
                *child = Some(Node { sum: 0, level, yaw_level, yaw, dx, dy });
            }
        }
        children
    }

    pub fn candidate(&self, node: &Node) -> Candidate {
        let centre = &self.window.centre;
        Candidate {
            pose: Pose2::new(
                centre.x + f64::from(node.dx) * self.cell,
                centre.y + f64::from(node.dy) * self.cell,
                centre.yaw + self.projections.steps().offset(f64::from(node.yaw)),
            ),
            score: node.sum as f32 / (255.0 * self.points as f32),
        }
    }

    /// Whether all poses of a window are too near to one and the same candidate to be distinct.
    fn is_taken(&self, node: &Node, found: &[Candidate]) -> bool {
        let cells = f64::from((1 << node.level) - 1);
        let yaws = f64::from((1 << node.yaw_level) - 1);
        let first = self.candidate(&Node { yaw: node.yaw << node.yaw_level, ..*node }).pose;
        let half_m = 0.5 * cells * self.cell;
        let steps = self.projections.steps();
        let half_yaw = 0.5 * (steps.offset(yaws) - steps.offset(0.0));
        let s = self.settings;
        found.iter().any(|other| {
            // The farthest corner, and the farthest end of the yaws.
            let x = (first.x + half_m - other.pose.x).abs() + half_m;
            let y = (first.y + half_m - other.pose.y).abs() + half_m;
            let yaw = geometry::wrap_angle(first.yaw + half_yaw - other.pose.yaw).abs() + half_yaw;
            x * x + y * y <= s.separation_m * s.separation_m && yaw <= s.separation_rad
        })
    }
}
