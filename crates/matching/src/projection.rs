use crate::search::Node;
use crate::{LikelihoodPyramid, SearchWindow};
use geometry::{Pose2, Vector2};
use std::f64::consts::PI;

/// The yaws of a search: equal steps, symmetric about the window's centre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct YawSteps {
    step: f64,
    half_count: u32,
}

impl YawSteps {
    /// Scan points farther than this do not make the steps finer, metres.
    const FAR: f64 = 20.0;

    /// Steps that move the farthest point by a cell: `acos(1 - cell^2 / (2 r^2))` (Hess et al.
    /// 2016, eq. 7).
    pub fn new(points: &[Vector2<f32>], window: &SearchWindow, cell: f64) -> Self {
        let farthest = points.iter().fold(0f32, |far, p| far.max(p.norm()));
        let farthest = f64::from(farthest).clamp(2.0 * cell, Self::FAR);
        let step = (1.0 - 0.5 * (cell / farthest).powi(2)).acos();
        let half = window.half_yaw_rad.max(0.0);
        if half >= PI - 0.5 * step {
            // The whole circle, each yaw once.
            let half_count = (PI / step - 0.5).ceil() as u32;
            return YawSteps { step: 2.0 * PI / f64::from(2 * half_count + 1), half_count };
        }
        YawSteps { step, half_count: (half / step + 1e-9) as u32 }
    }

    /// Number of yaws.
    pub fn count(&self) -> u32 {
        2 * self.half_count + 1
    }

    /// Yaw of a (possibly fractional) index, from the window's centre, radians.
    pub fn offset(&self, index: f64) -> f64 {
        (index - f64::from(self.half_count)) * self.step
    }
}

/// The scan's points turned to one yaw (or to the middle of several), as cells.
#[derive(Clone, Debug, Default)]
struct Projection {
    /// Indices into a level, see [`LikelihoodPyramid::linear`].
    linear: Vec<i32>,
    columns: Vec<i32>,
    min_column: i32,
    max_column: i32,
    /// Cells by which a point may be elsewhere at another yaw of the node.
    slack: i32,
}

/// All projections of a search, made when first needed.
pub(crate) struct Projections<'a> {
    pyramid: &'a LikelihoodPyramid,
    points: Vec<CellPoint>,
    /// The window's centre in cells.
    origin: Vector2<f32>,
    centre_yaw: f64,
    steps: YawSteps,
    /// By yaw level, then by index.
    made: Vec<Vec<Option<Projection>>>,
}

impl<'a> Projections<'a> {
    pub fn new(
        pyramid: &'a LikelihoodPyramid,
        points: &[Vector2<f32>],
        centre: &Pose2,
        steps: YawSteps,
    ) -> Self {
        let made = (0..=pyramid.top_level())
            .map(|level| vec![None; steps.count().div_ceil(1 << level) as usize])
            .collect();
        let per_metre = 1.0 / pyramid.cell_m() as f32;
        let points = shuffled(points)
            .map(|p| CellPoint {
                x: p.x * per_metre,
                y: p.y * per_metre,
                range: p.norm() * per_metre,
            })
            .collect();
        let origin = pyramid.in_cells(&centre.translation()).cast();
        Projections { pyramid, points, origin, centre_yaw: centre.yaw, steps, made }
    }

    pub fn steps(&self) -> &YawSteps {
        &self.steps
    }

    /// Upper bound of the sum of values over a node's poses, exact for a single pose; `None` as
    /// soon as it cannot exceed `floor`.
    pub fn bound(&mut self, node: &Node, floor: u32) -> Option<u32> {
        let (level, yaw) = (usize::from(node.yaw_level), node.yaw as usize);
        if self.made[level][yaw].is_none() {
            self.made[level][yaw] = Some(self.project(node.yaw_level, node.yaw));
        }
        let projection = self.made[level][yaw].as_ref()?;
        let window = (1 << node.level) + 2 * projection.slack;
        let table = (window as u32).next_power_of_two().trailing_zeros() as usize;
        if table > self.pyramid.top_level() {
            return Some(255 * self.points.len() as u32);
        }
        let cells = self.pyramid.level(table);
        let inside = self.pyramid.columns();
        let first = projection.min_column.saturating_add(node.dx);
        let last = projection.max_column.saturating_add(node.dx);
        if first >= inside.start && last < inside.end {
            let shift = node.dy * self.pyramid.stride() + node.dx;
            return sum_above(&projection.linear, floor, |&index| {
                cells.get(index.wrapping_add(shift) as usize).copied().unwrap_or(0)
            });
        }
        let shift = node.dy * self.pyramid.stride() + node.dx;
        let pairs: Vec<(i32, i32)> =
            projection.linear.iter().copied().zip(projection.columns.iter().copied()).collect();
        sum_above(&pairs, floor, |&(index, column)| {
            if inside.contains(&column.saturating_add(node.dx)) {
                cells.get(index.wrapping_add(shift) as usize).copied().unwrap_or(0)
            } else {
                0
            }
        })
    }

    fn project(&self, yaw_level: u8, yaw: u32) -> Projection {
        let first = yaw << yaw_level;
        let last = (first + (1 << yaw_level)).min(self.steps.count()) - 1;
        let middle = self.steps.offset(0.5 * (f64::from(first) + f64::from(last)));
        let half = (self.steps.offset(f64::from(last)) - middle) as f32;
        let (sin, cos) = (self.centre_yaw + middle).sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let mut projection = Projection {
            linear: Vec::with_capacity(self.points.len()),
            columns: Vec::with_capacity(self.points.len()),
            min_column: i32::MAX,
            max_column: i32::MIN,
            slack: 0,
        };
        let (origin, corner) = (self.origin, self.pyramid.linear(0, 0));
        let stride = self.pyramid.stride();
        for p in &self.points {
            let slack = slack_cells(p.range * half);
            let x = floor(origin.x + cos * p.x - sin * p.y) - slack;
            let y = floor(origin.y + sin * p.x + cos * p.y) - slack;
            projection.slack = projection.slack.max(slack);
            projection.linear.push(y.wrapping_mul(stride).wrapping_add(x).wrapping_add(corner));
            projection.columns.push(x);
            projection.min_column = projection.min_column.min(x);
            projection.max_column = projection.max_column.max(x);
        }
        projection
    }
}

/// A scan point in cells.
#[derive(Clone, Copy, Debug)]
struct CellPoint {
    x: f32,
    y: f32,
    range: f32,
}

/// Coordinates in cells are cut here: far outside of every grid, far inside of `i32` even when
/// multiplied by a row's length.
const FAR_CELLS: f32 = 200_000.0;

/// The floor of a number, clamped to [`FAR_CELLS`]; faster than `f32::floor` where that is a call.
#[inline]
fn floor(value: f32) -> i32 {
    let value = value.clamp(-FAR_CELLS, FAR_CELLS);
    let truncated = value as i32;
    truncated - i32::from(truncated as f32 > value)
}

/// How many cells away a point may fall that moves by `cells`; a little more than needed, for
/// rounding.
#[inline]
fn slack_cells(cells: f32) -> i32 {
    if cells <= 1e-6 { 0 } else { (cells + 1e-2).min(FAR_CELLS) as i32 + 1 }
}

/// Sum of the points' values, `None` as soon as even the largest values of the rest could not lift
/// it above `floor`.
#[inline]
fn sum_above<T>(points: &[T], floor: u32, value: impl Fn(&T) -> u8) -> Option<u32> {
    const BLOCK: usize = 32;
    let mut sum = 0;
    let mut left = points.len();
    for block in points.chunks(BLOCK) {
        sum += block.iter().map(|p| u32::from(value(p))).sum::<u32>();
        left -= block.len();
        if sum + 255 * left as u32 <= floor {
            return None;
        }
    }
    Some(sum)
}

/// The points in an order that spreads them over the scan, so that a bad pose shows early.
fn shuffled(points: &[Vector2<f32>]) -> impl Iterator<Item = &Vector2<f32>> {
    const STRIDE: usize = 16;
    (0..STRIDE).flat_map(|start| points.iter().skip(start).step_by(STRIDE))
}
