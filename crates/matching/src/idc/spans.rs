/// A piece of the reference as seen from the scan's place: between two bearings, in radians, and
/// two ranges, in metres. A single point is a span from itself to itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Bearings of both ends; less than half a turn apart, the second not wrapped.
    pub bearing: [f64; 2],
    /// Ranges of both ends.
    pub range: [f64; 2],
    /// Indices of the reference points at both ends; the first breaks ties.
    pub ends: [usize; 2],
    /// Whether it may be paired.
    pub visible: bool,
}

/// A place on a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Its range minus the wanted one, absolute, metres.
    pub gap_m: f64,
    /// Bearing minus the wanted one, radians.
    pub offset_rad: f64,
    /// Metres.
    pub range_m: f64,
    index: usize,
}

/// Ranges that differ by less are equal: rounding, metres.
const ROUNDING_M: f64 = 1e-9;

impl Span {
    /// The place at a range nearest to the wanted one: on the straight line between the ends,
    /// where `1 / range` is all but linear in the bearing, that is Lu and Milios's
    /// `a = (r1 r2 (a2 - a1) / r + r1 a1 - r2 a2) / (r1 - r2)`; otherwise the end nearer in range.
    fn at_range(&self, range_m: f64, bearing: f64) -> Place {
        let ([a1, a2], [r1, r2]) = (self.bearing, self.range);
        let r = range_m.clamp(r1.min(r2), r1.max(r2));
        let shares = 1.0 / r2 - 1.0 / r1;
        let at = if shares.abs() > 1e-12 {
            a1 + (a2 - a1) * ((1.0 / r - 1.0 / r1) / shares).clamp(0.0, 1.0)
        } else {
            // The whole span is at this range: as close to the wanted bearing as it goes.
            bearing.clamp(a1.min(a2), a1.max(a2))
        };
        let gap = (range_m - r).abs();
        let gap_m = if gap < ROUNDING_M { 0.0 } else { gap };
        Place { gap_m, offset_rad: at - bearing, range_m: r, index: self.ends[0] }
    }

    /// Range at a bearing between the ends.
    fn range_at(&self, bearing: f64) -> Option<f64> {
        let ([a1, a2], [r1, r2]) = (self.bearing, self.range);
        let share = if a1 == a2 { 0.5 } else { (bearing - a1) / (a2 - a1) };
        (0.0..=1.0).contains(&share).then(|| 1.0 / (1.0 / r1 + (1.0 / r2 - 1.0 / r1) * share))
    }
}

/// Bounds of the spans below a node.
#[derive(Clone, Copy)]
struct Bounds {
    bearing: [f64; 2],
    range: [f64; 2],
}

/// Spans by bearing, in a tree of bounds: both questions below cost about the logarithm of their
/// number.
pub(super) struct Spans {
    spans: Vec<Span>,
    /// Bounds in heap order; leaves hold [`LEAF`] spans at most.
    nodes: Vec<Bounds>,
}

/// Spans in a leaf are compared one by one.
const LEAF: usize = 4;
/// The same place, a turn on either way.
const TURNS: [f64; 3] = [0.0, -std::f64::consts::TAU, std::f64::consts::TAU];

impl Spans {
    pub fn new(mut spans: Vec<Span>) -> Self {
        let middle = |s: &Span| s.bearing[0] + s.bearing[1];
        spans.sort_by(|a, b| middle(a).total_cmp(&middle(b)).then(a.ends.cmp(&b.ends)));
        let mut nodes = Vec::new();
        bound(&spans, 0, &mut nodes);
        Spans { spans, nodes }
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Span> {
        self.spans.iter_mut()
    }

    /// Of the visible spans within a window of bearings, the place whose range is nearest to the
    /// wanted one; of several, the one nearest in bearing, and of those the first of the reference.
    pub fn at_range(&self, range_m: f64, bearing: f64, window_rad: f64) -> Option<Place> {
        let mut best = None;
        for turn in TURNS {
            self.search_range(0, &self.spans, (range_m, bearing + turn, window_rad), &mut best);
        }
        best
    }

    fn search_range(
        &self,
        node: usize,
        spans: &[Span],
        wanted: (f64, f64, f64),
        best: &mut Option<Place>,
    ) {
        let (range_m, bearing, window_rad) = wanted;
        if spans.len() <= LEAF {
            for span in spans.iter().filter(|span| span.visible) {
                let place = span.at_range(range_m, bearing);
                let inside = place.offset_rad.abs() <= window_rad;
                let key = |p: &Place| (p.gap_m, p.offset_rad.abs(), p.index);
                if inside && best.is_none_or(|b| key(&place) < key(&b)) {
                    *best = Some(place);
                }
            }
            return;
        }
        let (left, right) = spans.split_at(spans.len() / 2);
        let children = [(2 * node + 1, left), (2 * node + 2, right)];
        let far = |node: usize| {
            let Bounds { bearing: a, range: r } = self.nodes[node];
            let gap = outside(range_m, r);
            (if gap < ROUNDING_M { 0.0 } else { gap }, outside(bearing, a))
        };
        let mut children = children.map(|(node, spans)| (far(node), node, spans));
        if children[1].0 < children[0].0 {
            children.swap(0, 1);
        }
        for (far, node, spans) in children {
            let hopeless = best.is_some_and(|b| far > (b.gap_m, b.offset_rad.abs()));
            if far.1 <= window_rad && !hopeless {
                self.search_range(node, spans, wanted, best);
            }
        }
    }

    /// Whether a span lies in front of a range at a bearing.
    pub fn covers(&self, range_m: f64, bearing: f64) -> bool {
        TURNS.iter().any(|turn| self.search_cover(0, &self.spans, range_m, bearing + turn))
    }

    fn search_cover(&self, node: usize, spans: &[Span], range_m: f64, bearing: f64) -> bool {
        let Some(Bounds { bearing: a, range: r }) = self.nodes.get(node).copied() else {
            return false;
        };
        if outside(bearing, a) > 0.0 || r[0] >= range_m {
            return false;
        }
        if spans.len() <= LEAF {
            return spans.iter().any(|s| s.range_at(bearing).is_some_and(|r| r < range_m));
        }
        let (left, right) = spans.split_at(spans.len() / 2);
        self.search_cover(2 * node + 1, left, range_m, bearing)
            || self.search_cover(2 * node + 2, right, range_m, bearing)
    }
}

/// How far a value lies outside an interval.
fn outside(value: f64, [low, high]: [f64; 2]) -> f64 {
    (low - value).max(value - high).max(0.0)
}

/// Fills in the bounds of a node and those below it.
fn bound(spans: &[Span], node: usize, nodes: &mut Vec<Bounds>) -> Bounds {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]).min(b[1]), a[1].max(b[0]).max(b[1])];
    if nodes.len() <= node {
        nodes.resize(node + 1, Bounds { bearing: none, range: none });
    }
    let empty = Bounds { bearing: none, range: none };
    let bounds = if spans.len() <= LEAF {
        spans.iter().fold(empty, |b, s| Bounds {
            bearing: join(b.bearing, s.bearing),
            range: join(b.range, s.range),
        })
    } else {
        let (left, right) = spans.split_at(spans.len() / 2);
        let (a, b) = (bound(left, 2 * node + 1, nodes), bound(right, 2 * node + 2, nodes));
        Bounds { bearing: join(a.bearing, b.bearing), range: join(a.range, b.range) }
    };
    nodes[node] = bounds;
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng, rngs::StdRng};
    use std::f64::consts::{PI, TAU};

    fn random(rng: &mut StdRng, n: usize) -> Vec<Span> {
        let span = |index| {
            let start = rng.random_range(-PI..PI);
            let mut range = || rng.random_range(1.0..3.0);
            let range = [range(), range()];
            let bearing = [start, start + rng.random_range(-0.2..0.2)];
            Span { bearing, range, ends: [index, index], visible: rng.random_range(0..5) > 0 }
        };
        (0..n).map(span).collect()
    }

    #[test]
    fn the_tree_answers_as_all_spans_do() {
        let mut rng = StdRng::seed_from_u64(31);
        let mut found = 0;
        for n in [0, 1, 5, 40, 300] {
            let all = random(&mut rng, n);
            let spans = Spans::new(all.clone());
            for _ in 0..300 {
                let (range, bearing) = (rng.random_range(0.5..3.5), rng.random_range(-PI..PI));
                let window = rng.random_range(0.0..0.8);
                let key = |p: &Place| (p.gap_m, p.offset_rad.abs(), p.index);
                let places = all
                    .iter()
                    .filter(|s| s.visible)
                    .flat_map(|s| [0.0, TAU, -TAU].map(|turn| s.at_range(range, bearing + turn)));
                let best = places
                    .filter(|p| p.offset_rad.abs() <= window)
                    .min_by(|a, b| key(a).partial_cmp(&key(b)).expect("numbers"));
                assert_eq!(spans.at_range(range, bearing, window), best);
                let covers = |s: &Span| {
                    [0.0, TAU, -TAU]
                        .iter()
                        .any(|turn| s.range_at(bearing + turn).is_some_and(|r| r < range))
                };
                assert_eq!(spans.covers(range, bearing), all.iter().any(covers));
                found += usize::from(best.is_some_and(|p| p.gap_m == 0.0));
            }
        }
        assert!(found > 300, "{found}");
    }

    #[test]
    fn the_interpolation_is_the_paper_s_and_lies_on_the_line() {
        let span = Span { bearing: [0.3, 0.4], range: [2.0, 2.5], ends: [0, 1], visible: true };
        let ([a1, a2], [r1, r2], r) = (span.bearing, span.range, 2.2);
        let paper = (r1 * r2 * (a2 - a1) / r + r1 * a1 - r2 * a2) / (r1 - r2);
        let place = span.at_range(r, 0.0);
        assert!((place.offset_rad - paper).abs() < 1e-12 && place.gap_m == 0.0);
        let point = |r: f64, a: f64| geometry::Vector2::new(a.cos(), a.sin()) * r;
        let (from, to) = (point(r1, a1), point(r2, a2));
        let off = (to - from).normalize().perp(&(point(r, paper) - from));
        assert!(off.abs() < 2e-3, "{off}");
        assert_eq!(span.at_range(3.0, 0.0).gap_m, 0.5);
    }
}
