use matching::LinePoint;
use std::f64::consts::{PI, TAU};

/// Bins of a histogram of directions: three degrees each.
const BINS: usize = 120;
/// A turn is likely where the histograms agree at least so well, beside where they agree best: the
/// walls of a building stand in few directions, but not as much wall in each.
const LIKELY: f32 = 0.5;

/// In which directions the surfaces of a place face, how much of them in each (the angle histograms
/// of Weiss and von Puttkamer, 1995).
#[derive(Clone, Debug)]
pub(super) struct Directions([f32; BINS]);

/// A range of turns, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turns {
    pub centre: f64,
    pub half: f64,
}

impl Directions {
    /// The directions of some surface points.
    pub fn of(points: impl Iterator<Item = LinePoint>) -> Self {
        let mut counts = [0.0f32; BINS];
        for p in points {
            let turn = f64::from(p.ny).atan2(f64::from(p.nx)) / TAU;
            counts[(turn.rem_euclid(1.0) * BINS as f64) as usize % BINS] += 1.0;
        }
        // Walls are bent and normals are noisy by some degrees.
        let at = |i: usize| counts[i % BINS];
        Directions(std::array::from_fn(|i| at(i + BINS - 1) + at(i) + at(i + 1)))
    }

    /// By which turns a query's surfaces may face as those here do.
    pub fn turns_of(&self, query: &Directions) -> Vec<Turns> {
        let agreement: [f32; BINS] = std::array::from_fn(|turn| {
            (0..BINS).map(|i| query.0[i] * self.0[(i + turn) % BINS]).sum()
        });
        let best = agreement.iter().copied().fold(0.0, f32::max);
        let likely = |turn: usize| agreement[turn % BINS] >= LIKELY * best;
        let Some(gap) = (0..BINS).find(|&turn| !likely(turn)) else {
            return vec![Turns { centre: 0.0, half: PI }];
        };
        let step = TAU / BINS as f64;
        let mut turns: Vec<Turns> = Vec::new();
        let mut start = None;
        for turn in gap..=gap + BINS {
            match (start, likely(turn)) {
                (None, true) => start = Some(turn),
                (Some(first), false) => {
                    let centre = 0.5 * (first + turn - 1) as f64 * step;
                    turns.push(Turns { centre, half: 0.5 * (turn - first) as f64 * step });
                    start = None;
                }
                _ => {}
            }
        }
        turns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points that face in the given directions, degrees.
    fn facing(degrees: &[f64]) -> Vec<LinePoint> {
        let point = |d: &f64| {
            let (ny, nx) = d.to_radians().sin_cos();
            LinePoint { nx: nx as f32, ny: ny as f32, ..LinePoint::default() }
        };
        degrees.iter().map(point).collect()
    }

    fn turns(place: &[f64], query: &[f64]) -> Vec<Turns> {
        let query = Directions::of(facing(query).into_iter());
        Directions::of(facing(place).into_iter()).turns_of(&query)
    }

    fn is_likely(turns: &[Turns], degrees: f64) -> bool {
        let near =
            |t: &Turns| geometry::wrap_angle(degrees.to_radians() - t.centre).abs() <= t.half;
        turns.iter().any(near)
    }

    #[test]
    fn the_turn_between_two_views_of_a_place_is_among_the_likely_ones() {
        let walls = [10.0, 10.5, 11.0, 100.0, 101.0, 190.0, 190.5, 280.0, 33.0];
        for turn in [0.0, 1.0, 44.5, 90.0, 179.0, 181.0, 359.0] {
            let turned: Vec<f64> = walls.iter().map(|d| d - turn).collect();
            assert!(is_likely(&turns(&walls, &turned), turn), "{turn}");
        }
    }

    #[test]
    fn right_angles_leave_few_turns() {
        let walls = [0.0, 90.0, 180.0, 270.0];
        let turns = turns(&walls, &walls);
        assert_eq!(turns.len(), 4);
        assert!(turns.iter().map(|t| 2.0 * t.half).sum::<f64>() < 0.25 * TAU);
        assert!(!is_likely(&turns, 45.0));
    }

    #[test]
    fn where_surfaces_face_everywhere_or_are_none_every_turn_is_likely() {
        let round: Vec<f64> = (0..360).map(f64::from).collect();
        for points in [&round[..], &[]] {
            let turns = turns(points, points);
            assert!(is_likely(&turns, 77.0) && is_likely(&turns, -140.0));
        }
    }
}
