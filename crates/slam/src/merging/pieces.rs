use manifold::PatchId;
use std::collections::BTreeSet;

/// How often something is contradicted: pieces per metre of compared surface. The rate itself is
/// known by a gamma distribution, so that counts are negative binomial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    /// Shape of the distribution: pieces that were seen.
    pub pieces: f64,
    /// Its inverse scale: on so much surface, metres.
    pub on_m: f64,
}

impl Rate {
    /// Natural logarithm of the chance of so many pieces on so much surface.
    pub fn ln_chance(&self, pieces: usize, on_m: f64) -> f64 {
        self.ln_chances(pieces, on_m)[pieces]
    }

    /// The same for any number of pieces up to `most`.
    pub fn ln_chances(&self, most: usize, on_m: f64) -> Vec<f64> {
        let all_m = self.on_m + on_m;
        let mut chances = vec![self.pieces * (self.on_m / all_m).ln()];
        for i in 0..most {
            let more = (self.pieces + i as f64) / (i as f64 + 1.0) * (on_m / all_m);
            chances.push(chances[i] + more.ln());
        }
        chances
    }
}

/// Cell of a surface: the place whose level it is on, the side that has it, 0 for the places' own,
/// and where it is on the plan.
pub(super) type SurfaceCell = (PatchId, u8, i32, i32);

/// A cell by itself may be the edge of something; from so many on that hang together it is a piece.
const LEAST_CELLS: usize = 2;

/// How many pieces some contradicted cells of `cell_m` are: those of either side that hang together
/// are one, and another one for every further metre.
pub(super) fn pieces_of(mut cells: BTreeSet<SurfaceCell>, cell_m: f64) -> usize {
    let mut pieces = 0;
    while let Some(first) = cells.pop_first() {
        let (mut open, mut count) = (vec![first], 0);
        while let Some((level, side, u, v)) = open.pop() {
            count += 1;
            let around =
                (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (level, side, u + du, v + dv)));
            open.extend(around.filter(|cell| cells.remove(cell)));
        }
        if count >= LEAST_CELLS {
            pieces += ((count as f64 * cell_m) as usize).max(1);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chances_sum_to_one_and_tend_to_poisson() {
        let rate = Rate { pieces: 3.0, on_m: 10.0 };
        let chance = |pieces: usize| rate.ln_chance(pieces, 40.0).exp();
        let (sum, mean) = (0..2000).fold((0.0, 0.0), |(sum, mean), pieces| {
            (sum + chance(pieces), mean + pieces as f64 * chance(pieces))
        });
        assert!((sum - 1.0).abs() < 1e-9 && (mean - 12.0).abs() < 1e-6, "{sum} {mean}");
        // Where there is no surface there are no pieces.
        assert_eq!((rate.ln_chance(0, 0.0), rate.ln_chance(2, 0.0)), (0.0, f64::NEG_INFINITY));
        // A rate that is known well: Poisson with mean 2.
        let sharp = Rate { pieces: 2e6, on_m: 4e7 };
        let poisson = (-2.0f64).exp() * 8.0 / 6.0;
        assert!((sharp.ln_chance(3, 40.0).exp() - poisson).abs() < 1e-5);
    }

    #[test]
    fn what_hangs_together_is_one_piece_a_metre() {
        const FLOOR: PatchId = PatchId(0);
        let row = |side: u8, v: i32, count: i32| (0..count).map(move |u| (FLOOR, side, u, v));
        let pieces = |cells: Vec<SurfaceCell>| pieces_of(cells.into_iter().collect(), 0.2);
        assert_eq!(
            pieces(
                [(0, 3, 3), (1, 3, 4), (0, 9, 9)].map(|(side, u, v)| (FLOOR, side, u, v)).to_vec()
            ),
            0
        );
        assert_eq!(pieces(row(0, 0, 2).chain(row(0, 5, 4)).chain([(FLOOR, 0, 4, 6)]).collect()), 2);
        assert_eq!(pieces(row(0, 0, 5).chain(row(1, 1, 5)).collect()), 2);
        assert_eq!(pieces(row(1, -4, 13).collect()), 2);
        let upstairs = row(0, 0, 2).map(|(_, side, u, v)| (PatchId(7), side, u, v));
        assert_eq!(pieces(row(0, 1, 2).chain(upstairs).collect()), 2);
    }
}
