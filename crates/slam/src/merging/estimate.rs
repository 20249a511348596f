use geometry::Vector2;
use std::f64::consts::{FRAC_PI_2, LN_10};

/// How much less likely every further independent place that fits makes a wrong merge, in decades:
/// buildings repeat themselves, so that a wrong one that fits at one place often fits at the next
/// as well. Measured on twin buildings (see docs/math/merging.md), as are the others.
const DECADES_PER_PLACE: f64 = 1.5;
/// How likely a part of a building has a copy elsewhere, furniture and all, in decades: a room
/// often has one. The more squares it must hold, the less likely it is.
const COPY_DECADES: f64 = -0.3;
const DECADES_PER_HELD: f64 = -0.15;
/// Larger than this along either side no such copy is expected, metres. What is confirmed beyond
/// counts for more, decades.
const COPY_M: f64 = 20.0;
const DECADES_PER_BEYOND: f64 = -1.0;
/// Ways in which the copy may lie that are tried, over a quarter turn.
const TURNS: usize = 9;
/// Those beyond are counted among so many squares; the rest of a larger overlap is not needed.
pub(super) const MOST_SQUARES: usize = 80;
/// Every place that does not fit, and where one island sees through the other's walls, makes a
/// wrong merge five times as likely: 15 % of the right merges in real logs have one.
const DECADES_PER_CONTRADICTION: f64 = 0.7;
/// The share of sight lines through walls may exceed the usual by so much for nothing; every so
/// much beyond makes a wrong merge ten times as likely. Wrong merges of look-alike places had 0.04
/// in all and more wherever five places fitted, right ones in the same worlds 0.02 at most.
const MARGIN_THROUGH: f64 = 0.008;
const THROUGH_PER_DECADE: f64 = 0.004;
/// Contradicted surface is counted in pieces of this size, metres: a box, half a door.
const PIECE_M: f64 = 0.5;
/// Such pieces per metre of compared surface where two buildings look alike; few had less.
const PIECES_IF_ALIKE: f64 = 0.01;
/// And in the same building visited twice: what is taken before anything is measured, and for how
/// much surface that counts, metres.
const PIECES_USUALLY: f64 = 0.001;
const USUAL_M: f64 = 100.0;
/// That nothing contradicts speaks for a merge by so much at most, decades.
const MOST_CREDIT: f64 = 1.0;
/// Surfaces are compared where the estimate may come to so little, decades.
const WORTH_COMPARING: f64 = -3.0;

/// What speaks for and against a merge, as the estimate takes it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Observed {
    /// Independent places that fit.
    pub agreeing: usize,
    /// Independent places that do not, and where one sees through walls.
    pub contradicting: usize,
    /// Share of sight lines through walls.
    pub seen_through: f64,
    /// Surface compared, metres.
    pub compared_m: f64,
    /// Surface contradicted, metres.
    pub contradicted_m: f64,
    /// Confirmed squares.
    pub squares: usize,
    /// Those of them that a copy of a part of the building cannot hold.
    pub beyond: usize,
}

/// What robots find where they come back to a place in their own maps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usual {
    /// Share of sight lines through walls.
    pub seen_through: f64,
    /// Surface compared, metres.
    pub compared_m: f64,
    /// Surface contradicted, metres.
    pub contradicted_m: f64,
}

/// True when it is worth comparing surfaces: from what the places say the merge may come to be
/// joined or told of. Two places never suffice.
pub(super) fn may_suffice(observed: &Observed, usual: &Usual) -> bool {
    decades_at_best(observed, usual) <= WORTH_COMPARING
}

/// The best that [`decades`] can come to, from what the places say.
fn decades_at_best(observed: &Observed, usual: &Usual) -> f64 {
    places(observed) + against(observed, usual) - MOST_CREDIT
}

/// Decimal logarithm of the chance that a merge is wrong; positive: it certainly is.
///
/// The merge is wrong if the building only looks alike, or if it has an exact copy that holds all
/// that was confirmed but what lies beyond. Either is doubted or believed by the likelihood ratio
/// of the contradictions.
pub(super) fn decades(observed: &Observed, usual: &Usual) -> f64 {
    let either = (10f64.powf(places(observed)) + 10f64.powf(copied(observed))).log10();
    either + against(observed, usual) + surfaces(observed, usual)
}

fn copied(observed: &Observed) -> f64 {
    let held = observed.squares - observed.beyond;
    COPY_DECADES + DECADES_PER_HELD * held as f64 + DECADES_PER_BEYOND * observed.beyond as f64
}

fn places(observed: &Observed) -> f64 {
    -DECADES_PER_PLACE * (observed.agreeing as f64 - 1.0)
}

fn against(observed: &Observed, usual: &Usual) -> f64 {
    let beyond = (observed.seen_through - usual.seen_through - MARGIN_THROUGH).max(0.0);
    DECADES_PER_CONTRADICTION * observed.contradicting as f64 + beyond / THROUGH_PER_DECADE
}

/// Likelihood ratio of the contradicted pieces, Poisson distributed with one rate where buildings
/// look alike and another in the same one.
fn surfaces(observed: &Observed, usual: &Usual) -> f64 {
    let same =
        (PIECES_USUALLY * USUAL_M + usual.contradicted_m / PIECE_M) / (USUAL_M + usual.compared_m);
    let same = same.min(PIECES_IF_ALIKE);
    let pieces = observed.contradicted_m / PIECE_M;
    let expected = observed.compared_m * (PIECES_IF_ALIKE - same);
    let ratio = (pieces * (PIECES_IF_ALIKE / same).ln() - expected) / LN_10;
    ratio.max(-MOST_CREDIT)
}

/// How many of some squares, by their middles, no copy of [`COPY_M`] can hold wherever it lies and
/// however it is turned.
pub(super) fn beyond_a_copy(squares: &[Vector2<f64>]) -> usize {
    let held = |turn: usize| {
        let (sin, cos) = (FRAC_PI_2 * turn as f64 / TURNS as f64).sin_cos();
        let turned: Vec<(f64, f64)> =
            squares.iter().map(|p| (cos * p.x + sin * p.y, cos * p.y - sin * p.x)).collect();
        most_in_box(&turned)
    };
    squares.len() - (0..TURNS).map(held).max().unwrap_or(0)
}

/// The most of some points that an upright box of [`COPY_M`] holds: one whose lower sides touch
/// points.
fn most_in_box(points: &[(f64, f64)]) -> usize {
    let mut most = 0;
    for (left, _) in points {
        let mut column: Vec<f64> = points
            .iter()
            .filter(|(x, _)| (*left..=left + COPY_M).contains(x))
            .map(|(_, y)| *y)
            .collect();
        column.sort_by(f64::total_cmp);
        let mut end = 0;
        for (start, low) in column.iter().enumerate() {
            while end < column.len() && column[end] <= low + COPY_M {
                end += 1;
            }
            most = most.max(end - start);
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLEAR: Observed = Observed {
        agreeing: 6,
        contradicting: 0,
        seen_through: 0.01,
        compared_m: 200.0,
        contradicted_m: 0.0,
        squares: 20,
        beyond: 6,
    };
    const USUAL: Usual = Usual { seen_through: 0.015, compared_m: 100.0, contradicted_m: 0.1 };

    #[test]
    fn what_speaks_against_a_merge_makes_it_less_sure() {
        let clear = decades(&CLEAR, &USUAL);
        let worse = [
            Observed { agreeing: 3, ..CLEAR },
            Observed { contradicting: 1, ..CLEAR },
            Observed { seen_through: 0.05, ..CLEAR },
            Observed { compared_m: 50.0, ..CLEAR },
            Observed { contradicted_m: 1.0, ..CLEAR },
            Observed { beyond: 2, ..CLEAR },
            Observed { squares: 10, ..CLEAR },
        ];
        for observed in worse {
            let doubted = decades(&observed, &USUAL);
            assert!(doubted > clear, "{observed:?} {doubted} {clear}");
            assert!(decades_at_best(&observed, &USUAL) <= doubted + 1e-9);
        }
    }

    #[test]
    fn a_building_that_changes_is_not_taken_for_two() {
        let observed = Observed { contradicted_m: 2.0, ..CLEAR };
        let lively = Usual { contradicted_m: 1.0, ..USUAL };
        assert!(decades(&observed, &lively) < decades(&observed, &USUAL) - 1.0);
        // Where contradictions are as frequent as in look-alike buildings, they say nothing.
        let hopeless = Usual { contradicted_m: 50.0, ..USUAL };
        let none = Observed { contradicted_m: 0.0, ..CLEAR };
        assert_eq!(decades(&observed, &hopeless), decades(&none, &hopeless));
    }

    #[test]
    fn what_a_copy_can_hold_never_suffices() {
        // Twenty metres of corridor with rooms on either side.
        let observed = Observed { agreeing: 12, squares: 14, beyond: 0, ..CLEAR };
        assert!(decades(&observed, &USUAL) > -3.5);
    }

    #[test]
    fn squares_beyond_a_copy_are_counted() {
        let row = |count: usize| -> Vec<Vector2<f64>> {
            (0..count).map(|i| Vector2::new(3.0, 4.0) * i as f64).collect()
        };
        assert_eq!(beyond_a_copy(&[]), 0);
        // Five metres apart: five on twenty metres.
        assert_eq!(beyond_a_copy(&row(1)), 0);
        assert!((2..=4).contains(&beyond_a_copy(&row(8))));
        // A row of twenty metres and its rooms, turned anyhow.
        for turn in 0..12 {
            let (sin, cos) = (0.3 * f64::from(turn)).sin_cos();
            let place = |i: usize| {
                let (x, y) = ((i % 4) as f64 * 5.0, (i / 4) as f64 * 5.0);
                Vector2::new(cos * x - sin * y, sin * x + cos * y)
            };
            let squares: Vec<_> = (0..12).map(place).collect();
            assert_eq!(beyond_a_copy(&squares), 0, "{turn}");
        }
    }
}
