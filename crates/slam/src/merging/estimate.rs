use super::pieces::Rate;
use geometry::Vector2;
use std::f64::consts::{FRAC_PI_2, LN_10};

/// How much less likely every further independent place that fits makes a wrong merge, in decades:
/// buildings repeat themselves, so that a wrong one that fits at one place often fits at the next
/// as well. Measured on twin buildings (see docs/math/merging.md), as are the others.
const DECADES_PER_PLACE: f64 = 1.5;
/// But no less likely than this, decades: a building may have the same walls all over, on another
/// storey, or turned by half a turn. That the rest differs must be seen.
const MOST_OF_PLACES: f64 = 6.0;
/// How likely a part of a building has a copy elsewhere, furniture and all, in decades: a room
/// often has one. The more squares it must hold, the less likely it is.
const COPY_DECADES: f64 = -0.3;
const DECADES_PER_HELD: f64 = -0.15;
/// Larger than this along either side no such copy is expected, metres. What is confirmed beyond
/// counts for more, decades.
const COPY_M: f64 = 20.0;
const DECADES_PER_BEYOND: f64 = -1.0;
/// So many of them at most, for the same reason.
const MOST_BEYOND: f64 = 4.0;
/// Ways in which the copy may lie that are tried, over a quarter turn.
const TURNS: usize = 9;
/// Those beyond are counted among so many squares; the rest of a larger overlap is not needed.
pub(super) const MOST_SQUARES: usize = 80;
/// So many smaller squares of compared surface likewise: 81 fill a copy.
pub(super) const MOST_SPREAD: usize = 200;
/// Every place that does not fit, and where one island sees through the other's walls, makes a
/// wrong merge five times as likely: 15 % of the right merges in real logs have one.
const DECADES_PER_CONTRADICTION: f64 = 0.7;
/// The share of sight lines through walls may exceed the usual by so much for nothing; every so
/// much beyond makes a wrong merge ten times as likely. Wrong merges of look-alike places had 0.04
/// in all and more wherever five places fitted, right ones in the same worlds 0.02 at most.
const MARGIN_THROUGH: f64 = 0.008;
const THROUGH_PER_DECADE: f64 = 0.004;
/// Contradicted pieces where two buildings look alike: 0.15 a metre in the mean, but anything from
/// hardly any to many. From 0.03 where four and more places of twin buildings fitted, mostly 0.2.
const ALIKE: Rate = Rate { pieces: 1.0, on_m: 1.0 / 0.15 };
/// Beyond what is copied exactly: other walls. 0.2 to 0.6 a metre around copied corridors.
const ELSEWHERE: Rate = Rate { pieces: 4.0, on_m: 4.0 / 0.3 };
/// And in the same building visited twice: what is taken before anything is measured.
const USUALLY: Rate = Rate { pieces: 0.1, on_m: 100.0 };
/// That nothing contradicts speaks for a merge by so much at most, decades.
const MOST_CREDIT: f64 = 1.5;
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
    /// That of it which a copy of a part of the building cannot hold, metres.
    pub beyond_m: f64,
    /// Surface contradicted, metres; for the record.
    pub contradicted_m: f64,
    /// Pieces of contradicted surface.
    pub pieces: usize,
    /// Confirmed squares.
    pub squares: usize,
    /// Those of them that such a copy cannot hold.
    pub beyond: usize,
}

/// What robots find where they come back to a place in their own maps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usual {
    /// Share of sight lines through walls.
    pub seen_through: f64,
    /// Surface compared, metres.
    pub compared_m: f64,
    /// Pieces of contradicted surface.
    pub pieces: usize,
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
    let alike = places(observed) + surfaces(observed, usual);
    let either = 10f64.powf(alike) + 10f64.powf(copied(observed, usual));
    either.log10() + against(observed, usual)
}

/// The chance of a copy. Beyond it are other walls: what tells where it is there is confirmed by
/// accident, or all that is contradicted is there. Both look at the same walls, so that only what
/// says more counts.
fn copied(observed: &Observed, usual: &Usual) -> f64 {
    let held = observed.squares - observed.beyond;
    let confirmed = DECADES_PER_BEYOND * (observed.beyond as f64).min(MOST_BEYOND)
        + surfaces(observed, usual).max(0.0);
    COPY_DECADES + DECADES_PER_HELD * held as f64 + confirmed.min(beyond(observed, usual))
}

fn places(observed: &Observed) -> f64 {
    -(DECADES_PER_PLACE * (observed.agreeing as f64 - 1.0)).min(MOST_OF_PLACES)
}

fn against(observed: &Observed, usual: &Usual) -> f64 {
    let beyond = (observed.seen_through - usual.seen_through - MARGIN_THROUGH).max(0.0);
    DECADES_PER_CONTRADICTION * observed.contradicting as f64 + beyond / THROUGH_PER_DECADE
}

/// How often the same building is contradicted.
fn same(usual: &Usual) -> Rate {
    Rate { pieces: USUALLY.pieces + usual.pieces as f64, on_m: USUALLY.on_m + usual.compared_m }
}

/// Likelihood ratio of the contradicted pieces in a building that looks alike and in the same one.
fn surfaces(observed: &Observed, usual: &Usual) -> f64 {
    let ln_chance = |rate: &Rate| rate.ln_chance(observed.pieces, observed.compared_m);
    (ln_chance(&ALIKE) - ln_chance(&same(usual))) / LN_10
}

/// And where the building is the same as far as a copy reaches, and another one beyond it.
fn beyond(observed: &Observed, usual: &Usual) -> f64 {
    let same = same(usual);
    let all = observed.pieces;
    let inside = same.ln_chances(all, (observed.compared_m - observed.beyond_m).max(0.0));
    let outside = ELSEWHERE.ln_chances(all, observed.beyond_m);
    let chance: f64 = (0..=all).map(|i| (inside[i] + outside[all - i]).exp()).sum();
    chance.log10() - same.ln_chance(all, observed.compared_m) / LN_10
}

/// How much of something that lies at some points no copy of [`COPY_M`] can hold wherever it lies
/// and however it is turned.
pub(super) fn beyond_a_copy(points: &[(Vector2<f64>, f64)]) -> f64 {
    let held = |turn: usize| {
        let (sin, cos) = (FRAC_PI_2 * turn as f64 / TURNS as f64).sin_cos();
        let turned = |(p, amount): &(Vector2<f64>, f64)| {
            (cos * p.x + sin * p.y, cos * p.y - sin * p.x, *amount)
        };
        most_in_box(&points.iter().map(turned).collect::<Vec<_>>())
    };
    let all: f64 = points.iter().map(|(_, amount)| amount).sum();
    (all - (0..TURNS).map(held).fold(0.0, f64::max)).max(0.0)
}

/// The most of some points (along x, along y, amount) that an upright box of [`COPY_M`] holds: one
/// whose lower sides touch points.
fn most_in_box(points: &[(f64, f64, f64)]) -> f64 {
    let mut most: f64 = 0.0;
    for (left, _, _) in points {
        let within = |p: &&(f64, f64, f64)| (*left..=left + COPY_M).contains(&p.0);
        let mut column: Vec<(f64, f64)> =
            points.iter().filter(within).map(|&(_, y, amount)| (y, amount)).collect();
        column.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut end, mut held) = (0, 0.0);
        for &(low, amount) in &column {
            while end < column.len() && column[end].0 <= low + COPY_M {
                held += column[end].1;
                end += 1;
            }
            most = most.max(held);
            held -= amount;
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLEAR: Observed = Observed {
        agreeing: 4,
        contradicting: 0,
        seen_through: 0.01,
        compared_m: 200.0,
        beyond_m: 60.0,
        contradicted_m: 0.0,
        pieces: 0,
        squares: 20,
        beyond: 6,
    };
    const USUAL: Usual = Usual { seen_through: 0.015, compared_m: 100.0, pieces: 0 };

    #[test]
    fn what_speaks_against_a_merge_makes_it_less_sure() {
        let clear = decades(&CLEAR, &USUAL);
        let worse = [
            Observed { agreeing: 3, ..CLEAR },
            Observed { contradicting: 1, ..CLEAR },
            Observed { seen_through: 0.05, ..CLEAR },
            Observed { compared_m: 50.0, ..CLEAR },
            Observed { pieces: 1, ..CLEAR },
            Observed { beyond: 1, beyond_m: 20.0, ..CLEAR },
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
        let observed = Observed { pieces: 4, ..CLEAR };
        let lively = Usual { pieces: 3, ..USUAL };
        assert!(decades(&observed, &lively) < decades(&observed, &USUAL) - 1.0);
    }

    #[test]
    fn pieces_of_contradicted_wall_refuse_a_merge() {
        // Half a turn of a nearly symmetric building; a copied corridor that ends in one of the
        // two.
        let turned = Observed { agreeing: 7, pieces: 11, compared_m: 190.0, ..CLEAR };
        assert!(decades(&turned, &USUAL) > -2.5);
        let ends = Observed { compared_m: 95.0, beyond_m: 5.0, squares: 8, beyond: 0, ..CLEAR };
        for beyond_m in [0.0, 5.0, 15.0] {
            let ends = Observed { pieces: 2, beyond_m, ..ends };
            assert!(decades(&ends, &USUAL) > -1.7, "{beyond_m}");
        }
    }

    #[test]
    fn what_a_copy_can_hold_never_suffices() {
        // Twenty metres of corridor with rooms on either side.
        let observed = Observed { agreeing: 12, squares: 14, beyond: 0, beyond_m: 5.0, ..CLEAR };
        assert!(decades(&observed, &USUAL) > -3.5);
    }

    #[test]
    fn squares_beyond_a_copy_are_counted() {
        let row = |count: usize| -> Vec<Vector2<f64>> {
            (0..count).map(|i| Vector2::new(3.0, 4.0) * i as f64).collect()
        };
        let beyond = |middles: &[Vector2<f64>]| {
            beyond_a_copy(&middles.iter().map(|p| (*p, 0.5)).collect::<Vec<_>>())
        };
        assert_eq!(beyond(&[]), 0.0);
        // Five metres apart: five on twenty metres.
        assert_eq!(beyond(&row(1)), 0.0);
        assert!((1.0..=2.0).contains(&beyond(&row(8))));
        // A row of twenty metres and its rooms, turned anyhow.
        for turn in 0..12 {
            let (sin, cos) = (0.3 * f64::from(turn)).sin_cos();
            let place = |i: usize| {
                let (x, y) = ((i % 4) as f64 * 5.0, (i / 4) as f64 * 5.0);
                Vector2::new(cos * x - sin * y, sin * x + cos * y)
            };
            let squares: Vec<_> = (0..12).map(place).collect();
            assert_eq!(beyond(&squares), 0.0, "{turn}");
        }
    }
}
