use serde::{Deserialize, Serialize};

/// How surface lines are fitted to a scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LineFitSettings {
    /// Wanted length of surface under a fit, metres: long enough to tell its direction from noise.
    pub length_m: f64,
    /// Fewest neighbours to each side of a centred window.
    pub min_neighbours: usize,
    /// Most neighbours to each side.
    pub max_neighbours: usize,
    /// Two successive hits farther apart than this share of their range (plus `jump_m`) lie on different
    /// surfaces.
    pub jump_ratio: f64,
    /// See `jump_ratio`, metres.
    pub jump_m: f64,
    /// A window whose points stray farther from its line than this (standard deviation, metres) is no
    /// line.
    pub straight_m: f64,
    /// Shift points onto their lines by this share of their distance.
    pub smooth: f64,
}

impl Default for LineFitSettings {
    fn default() -> Self {
        LineFitSettings {
            length_m: 0.25,
            min_neighbours: 2,
            max_neighbours: 10,
            jump_ratio: 0.1,
            jump_m: 0.1,
            straight_m: 0.03,
            smooth: 0.0,
        }
    }
}

/// The line through a point's neighbourhood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineFit {
    /// Unit normal; its sign is arbitrary.
    pub normal: (f64, f64),
    /// Signed distance of the point from the line, along `normal`, metres.
    pub distance: f64,
    /// Variance of the normal's direction, rad^2.
    pub normal_variance: f64,
}

/// Running sums over hits in beam order; differences of two give a window's moments in O(1).
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// Fits a line around every hit. `hits` are `(x, y, range)` in beam order, in a frame near the laser;
/// `starts_new[i]` tells that hit `i` is not on the same surface run as hit `i - 1` for reasons of its own
/// (missing beams). `range_std_m` is the measurement noise that no residual is trusted below.
///
/// Each hit takes the straightest of three windows: centred on it, ending at it, starting at it, so
/// that fits do not reach around corners.
pub fn fit_lines(
    hits: &[(f64, f64, f64)],
    starts_new: &[bool],
    range_std_m: f64,
    s: &LineFitSettings,
) -> Vec<Option<LineFit>> {
    let runs = runs(hits, starts_new, s);
    let sums = running_sums(hits);
    let spacing = |i: usize, j: usize| {
        let d = (hits[j].0 - hits[i].0, hits[j].1 - hits[i].1);
        d.0.hypot(d.1)
    };
    let mut fits = Vec::with_capacity(hits.len());
    for run in runs {
        for i in run.clone() {
            let (mut a, mut b) = (i, i);
            // Grow a window on each side to half the wanted length.
            while a > run.start && i - a < s.max_neighbours
                && (i - a < s.min_neighbours || spacing(a, i) < 0.5 * s.length_m)
            {
                a -= 1;
            }
            while b + 1 < run.end && b - i < s.max_neighbours
                && (b - i < s.min_neighbours || spacing(i, b) < 0.5 * s.length_m)
            {
                b += 1;
            }
            let (mut left, mut right) = (a, b);
            let reach = 2 * s.max_neighbours;
            while left > run.start && i - left < reach
                && (i - left < 2 * s.min_neighbours || spacing(left, i) < s.length_m)
            {
                left -= 1;
            }
            while right + 1 < run.end && right - i < reach
                && (right - i < 2 * s.min_neighbours || spacing(i, right) < s.length_m)
            {
                right += 1;
            }
            let windows = [(a, b, 1.0), (left, i, 1.5), (i, right, 1.5)];
            let best = windows
                .iter()
                .filter_map(|&(from, to, handicap)| {
                    let fit = fit_window(&sums, from, to, range_std_m, s)?;
                    Some((fit.normal_variance * handicap * handicap, fit))
                })
                .min_by(|p, q| p.0.total_cmp(&q.0));
            fits.push(best.map(|(_, fit)| {
                let centre = fit.distance;
                let (nx, ny) = fit.normal;
                LineFit { distance: nx * hits[i].0 + ny * hits[i].1 - centre, ..fit }
            }));
        }
    }
    fits
}

/// Ranges of successive hits without a jump.
fn runs(
    hits: &[(f64, f64, f64)],
    starts_new: &[bool],
    s: &LineFitSettings,
) -> Vec<std::ops::Range<usize>> {
    let mut runs = Vec::new();
    let mut start = 0;
    for i in 1..=hits.len() {
        let broken = i == hits.len() || starts_new[i] || {
            let (p, q) = (hits[i - 1], hits[i]);
            (q.0 - p.0).hypot(q.1 - p.1) > s.jump_m + s.jump_ratio * p.2.min(q.2)
        };
        if broken {
            runs.push(start..i);
            start = i;
        }
    }
    runs
}

fn running_sums(hits: &[(f64, f64, f64)]) -> Vec<Sums> {
    let mut sums = Vec::with_capacity(hits.len() + 1);
    let mut t = Sums::default();
    sums.push(t);
    for &(x, y, _) in hits {
        t = Sums { x: t.x + x, y: t.y + y, xx: t.xx + x * x, xy: t.xy + x * y, yy: t.yy + y * y };
        sums.push(t);
    }
    sums
}

/// Total least squares line over hits `from..=to`; `distance` holds the line's offset for now.
fn fit_window(
    sums: &[Sums],
    from: usize,
    to: usize,
    range_std_m: f64,
    s: &LineFitSettings,
) -> Option<LineFit> {
    let n = (to + 1 - from) as f64;
    if n < 3.0 {
        return None;
    }
    let (a, b) = (&sums[from], &sums[to + 1]);
    let (mx, my) = ((b.x - a.x) / n, (b.y - a.y) / n);
    let xx = (b.xx - a.xx) / n - mx * mx;
    let xy = (b.xy - a.xy) / n - mx * my;
    let yy = (b.yy - a.yy) / n - my * my;
    let (half_sum, half_diff) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let spread = half_diff.hypot(xy);
    let (large, small) = (half_sum + spread, (half_sum - spread).max(0.0));
    let residual = small * n / (n - 2.0);
    if residual > s.straight_m * s.straight_m || large < 1e-8 || small > 0.15 * large {
        return None;
    }
    let tangent = 0.5 * xy.atan2(half_diff);
    let (sin, cos) = tangent.sin_cos();
    let normal = (-sin, cos);
    let noise = residual.max(range_std_m * range_std_m);
    Some(LineFit {
        normal,
        distance: normal.0 * mx + normal.1 * my,
        normal_variance: noise / (n * large),
    })
}
