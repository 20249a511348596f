use crate::{Cell, OccupancyGrid};
use geometry::Vector2;
use std::collections::BTreeMap;

/// The outlines of all walls as closed polylines in the map frame, metres; walls lie to the left
/// of an outline's direction. Each is simplified so that it stays within `tolerance_m` of the
/// cells' smoothed border.
///
/// The contour is the marching-squares line at one half through the centres of the cells (Lorensen
/// and Cline 1987 in two dimensions), with ambiguous squares joined diagonally, as the eye does.
pub fn wall_outlines(grid: &OccupancyGrid, tolerance_m: f64) -> Vec<Vec<Vector2<f64>>> {
    let frame = grid.frame();
    let tolerance = (tolerance_m / frame.resolution_m).max(0.0);
    // Half-cell steps to map coordinates: node 2 is the centre of cell 0.
    let place = |p: &Vector2<f64>| frame.origin + p.add_scalar(-0.5) * frame.resolution_m;
    trace(half_steps(grid))
        .into_iter()
        .map(|ring| simplify_ring(&ring, tolerance).iter().map(place).collect())
        .collect()
}

/// A point between two cell centres, in half cells; the grid is padded by one cell.
type Node = (u32, u32);

/// The pieces of contour in all squares of four cell centres: from each node to the next.
///
/// A node lies on a border between an occupied and another cell, and exactly one piece leaves it.
fn half_steps(grid: &OccupancyGrid) -> BTreeMap<Node, Node> {
    let (width, height) = (grid.frame().width, grid.frame().height);
    let occupied = |c: usize, r: usize| {
        // Cells are shifted by the padding.
        (1..=width).contains(&c)
            && (1..=height).contains(&r)
            && grid.cell(c - 1, r - 1) == Cell::Occupied
    };
    let mut next = BTreeMap::new();
    let in_reach = |r: usize| {
        let has_wall =
            |r: usize| (1..=height).contains(&r) && grid.row(r - 1).contains(&Cell::Occupied);
        has_wall(r) || has_wall(r + 1)
    };
    for r in (0..=height).filter(|&r| in_reach(r)) {
        for c in 0..=width {
            let corners =
                [occupied(c, r), occupied(c + 1, r), occupied(c + 1, r + 1), occupied(c, r + 1)];
            for (from, to) in pieces(corners) {
                let node = |side: usize| {
                    // Middles of the bottom, right, top and left side.
                    let (dx, dy) = [(1, 0), (2, 1), (1, 2), (0, 1)][side];
                    ((2 * c + dx) as u32, (2 * r + dy) as u32)
                };
                next.insert(node(from), node(to));
            }
        }
    }
    next
}

/// The pieces of contour through one square: sides (bottom, right, top, left) where they enter and
/// leave.
///
/// Corners go counter-clockwise from the lower left; the occupied side is on the left of a piece.
fn pieces(corners: [bool; 4]) -> impl Iterator<Item = (usize, usize)> {
    // Side k lies between corners k and k + 1. Going round counter-clockwise, a piece leaves
    // through a side where free turns to occupied and enters through one where occupied turns to
    // free.
    let enters: Vec<usize> = (0..4).filter(|&k| corners[k] && !corners[(k + 1) % 4]).collect();
    let leaves: Vec<usize> = (0..4).filter(|&k| !corners[k] && corners[(k + 1) % 4]).collect();
    enters.into_iter().map(move |k| {
        // The next such side counter-clockwise: it cuts off the free corners between, which joins
        // occupied corners across a diagonal.
        let out = (1..4).map(|step| (k + step) % 4).find(|side| leaves.contains(side));
        (k, out.unwrap_or(k))
    })
}

/// Follows the pieces round to closed rings, in the order of their smallest nodes.
fn trace(mut next: BTreeMap<Node, Node>) -> Vec<Vec<Vector2<f64>>> {
    let mut rings = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut ring = Vec::new();
        let mut at = start;
        while let Some(to) = next.remove(&at) {
            ring.push(Vector2::new(f64::from(at.0), f64::from(at.1)) / 2.0);
            at = to;
        }
        rings.push(ring);
    }
    rings
}

/// A closed ring with fewer corners: split at its two farthest-apart points, each half simplified.
fn simplify_ring(ring: &[Vector2<f64>], tolerance: f64) -> Vec<Vector2<f64>> {
    let far = |from: usize| {
        let distance = |k: &usize| (ring[*k] - ring[from]).norm_squared();
        (0..ring.len()).max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    let (a, b) = (far(0), far(far(0)));
    let (a, b) = (a.min(b), a.max(b));
    if a == b {
        return ring.to_vec();
    }
    let second: Vec<_> = ring[b..].iter().chain(&ring[..=a]).copied().collect();
    let mut simple = simplify(&ring[a..=b], tolerance);
    simple.pop();
    simple.extend(simplify(&second, tolerance));
    simple.pop();
    simple
}

/// The polyline with as few of its points as stay within `tolerance` of it (Douglas and Peucker
/// 1973).
pub(crate) fn simplify(points: &[Vector2<f64>], tolerance: f64) -> Vec<Vector2<f64>> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    (keep[0], keep[points.len() - 1]) = (true, true);
    let mut open = vec![(0, points.len() - 1)];
    while let Some((first, last)) = open.pop() {
        let distance = |k: usize| distance_to_segment(points[k], points[first], points[last]);
        let farthest = (first + 1..last).max_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        if let Some(k) = farthest.filter(|&k| distance(k) > tolerance) {
            keep[k] = true;
            open.extend([(first, k), (k, last)]);
        }
    }
    points.iter().zip(keep).filter_map(|(p, kept)| kept.then_some(*p)).collect()
}

pub(crate) fn distance_to_segment(p: Vector2<f64>, a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let d = b - a;
    let length2 = d.norm_squared();
    let t = if length2 > 0.0 { ((p - a).dot(&d) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (p - a - d * t).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn simplified_lines_stay_within_tolerance(
            points in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64), 2..60),
            tolerance in 0.0..3.0_f64,
        ) {
            let points: Vec<_> = points.into_iter().map(|(x, y)| Vector2::new(x, y)).collect();
            let simple = simplify(&points, tolerance);
            prop_assert_eq!(simple.first(), points.first());
            prop_assert_eq!(simple.last(), points.last());
            for p in &points {
                let to_piece = |w: &[Vector2<f64>]| distance_to_segment(*p, w[0], w[1]);
                let distance = simple.windows(2).map(to_piece).fold(f64::INFINITY, f64::min);
                prop_assert!(distance <= tolerance + 1e-12);
            }
        }
    }
}
