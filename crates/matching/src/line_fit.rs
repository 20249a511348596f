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
    /// Two successive hits farther apart than this share of their range (plus `jump_m`) lie on
    /// different surfaces.
    pub jump_ratio: f64,
    /// See `jump_ratio`, metres.
    pub jump_m: f64,
    /// A window whose points stray farther from its line than this (standard deviation, metres) is
    /// no line.
    pub straight_m: f64,
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

/// Fits a line around every hit. `hits` are `(x, y, range)` in beam order, in a frame near the
/// laser; `starts_new[i]` tells that hit `i` is not on the same surface run as hit `i - 1` for
/// reasons of its own (missing beams). `range_std_m` is the measurement noise that no residual is
/// trusted below.
///
/// Each hit takes the straightest of three windows: centred on it, ending at it, starting at it, so
/// that fits do not reach around corners.
pub fn fit_lines(
    hits: &[(f64, f64, f64)],
    starts_new: &[bool],
    range_std_m: f64,
    s: &LineFitSettings,
) -> Vec<Option<LineFit>> {
    let sums = running_sums(hits);
    let mut fits = Vec::with_capacity(hits.len());
    for run in runs(hits, starts_new, s) {
        let centred = Reach::new(0.5 * s.length_m, s.min_neighbours, s.max_neighbours);
        let one_sided = Reach::new(s.length_m, 2 * s.min_neighbours, 2 * s.max_neighbours);
        let mut near = (run.start, run.start);
        let mut far = (run.start, run.start);
        for i in run.clone() {
            near = centred.window(hits, &run, i, near);
            far = one_sided.window(hits, &run, i, far);
            let fit = |from, to| fit_window(&sums, from, to, range_std_m, s);
            let mut best = fit(near.0, near.1);
            let plain = 4.0 * range_std_m * range_std_m;
            let good = near.0 < i && i < near.1;
            // On a plain wall nothing beats the window around the point.
            if !(good && best.is_some_and(|w| w.residual <= plain)) {
                for window in [fit(far.0, i), fit(i, far.1)].into_iter().flatten() {
                    let surer =
                        best.is_none_or(|b| ONE_SIDED * window.normal_variance < b.normal_variance);
                    if surer {
                        best = Some(window);
                    }
                }
            }
            fits.push(best.map(|window| window.line_at(hits[i])));
        }
    }
    fits
}

/// A window that ends at its point must be this much surer of its direction than one around it.
const ONE_SIDED: f64 = 2.0;

/// How far a window reaches to each side of its point.
struct Reach {
    length2: f64,
    fewest: usize,
    most: usize,
}

impl Reach {
    fn new(length: f64, fewest: usize, most: usize) -> Self {
        Reach { length2: length * length, fewest, most }
    }

    /// The window around hit `i`, given the one around the hit before: both ends only move on, so a
    /// whole run takes linear time.
    fn window(
        &self,
        hits: &[(f64, f64, f64)],
        run: &std::ops::Range<usize>,
        i: usize,
        last: (usize, usize),
    ) -> (usize, usize) {
        let inside = |j: usize| {
            let (dx, dy) = (hits[j].0 - hits[i].0, hits[j].1 - hits[i].1);
            dx * dx + dy * dy < self.length2
        };
        let (mut a, mut b) = (last.0.max(i.saturating_sub(self.most)), last.1.max(i));
        while i - a > self.fewest && !inside(a) {
            a += 1;
        }
        while b + 1 < run.end && b - i < self.most && (b - i < self.fewest || inside(b + 1)) {
            b += 1;
        }
        (a, b)
    }
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
            let (dx, dy) = (q.0 - p.0, q.1 - p.1);
            let jump = s.jump_m + s.jump_ratio * p.2.min(q.2);
            dx * dx + dy * dy > jump * jump
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

/// Scatter of a window's points.
#[derive(Clone, Copy, Debug)]
struct Window {
    mean: (f64, f64),
    half_diff: f64,
    xy: f64,
    spread: f64,
    residual: f64,
    normal_variance: f64,
}

/// Total least squares over hits `from..=to`; `None` if they are no line.
fn fit_window(
    sums: &[Sums],
    from: usize,
    to: usize,
    range_std_m: f64,
    s: &LineFitSettings,
) -> Option<Window> {
    let n = (to + 1 - from) as f64;
    if n < 3.0 {
        return None;
    }
    let (a, b) = (&sums[from], &sums[to + 1]);
    let inverse = 1.0 / n;
    let (mx, my) = ((b.x - a.x) * inverse, (b.y - a.y) * inverse);
    let xx = (b.xx - a.xx) * inverse - mx * mx;
    let xy = (b.xy - a.xy) * inverse - mx * my;
    let yy = (b.yy - a.yy) * inverse - my * my;
    let (half_sum, half_diff) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let spread = (half_diff * half_diff + xy * xy).sqrt();
    let (large, small) = (half_sum + spread, (half_sum - spread).max(0.0));
    let residual = small * n / (n - 2.0);
    if residual > s.straight_m * s.straight_m || large < 1e-8 || small > 0.15 * large {
        return None;
    }
    let noise = residual.max(range_std_m * range_std_m);
    let normal_variance = noise / (n * large);
    Some(Window { mean: (mx, my), half_diff, xy, spread, residual, normal_variance })
}

impl Window {
    /// The window's line as seen from one of its points.
    fn line_at(&self, hit: (f64, f64, f64)) -> LineFit {
        // Eigenvector of the larger eigenvalue, from the row of the scatter matrix that is better
        // conditioned.
        let (tx, ty) = if self.half_diff >= 0.0 {
            (self.spread + self.half_diff, self.xy)
        } else {
            (self.xy, self.spread - self.half_diff)
        };
        let inverse = 1.0 / (tx * tx + ty * ty).sqrt();
        let normal = (-ty * inverse, tx * inverse);
        let distance = normal.0 * (hit.0 - self.mean.0) + normal.1 * (hit.1 - self.mean.1);
        LineFit { normal, distance, normal_variance: self.normal_variance }
    }
}
