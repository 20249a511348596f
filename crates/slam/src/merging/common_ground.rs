use super::pieces::{SurfaceCell, pieces_of};
use super::surroundings::{Doubt, Surroundings};
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{Pose2, Vector2};
use manifold::PatchId;
use matching::LinePoint;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Surfaces are counted in cells of this side, metres, ...
const CELL_M: f64 = 0.2;
/// ... and these in squares of this side, about a room's.
const SQUARE_M: f64 = 5.0;
/// A square tells where it is when so much surface is confirmed across any direction, metres; a
/// corridor's plain walls fit all along it.
const TELLING_M: f64 = 0.5;
/// With so much contradicted it is no longer confirmed, metres.
const DOUBTED_M: f64 = 0.3;
/// Where there is something to compare is told in squares of so many cells.
const SPREAD_CELLS: i32 = 12;
/// Of so many places at most the surroundings are compared.
const MOST_PLACES: usize = 60;

/// A place and where it lies as seen from a patch of the other side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub place: PatchId,
    pub from: PatchId,
    pub from_place: Pose2,
    /// What that may be off, where nothing was found to fit.
    pub doubt: Doubt,
}

/// What two sides, two islands or two visits, show of the same ground.
#[derive(Clone, Debug, Default)]
pub(super) struct CommonGround {
    /// Surface of either side that the other knows something of, metres (the mean of both sides).
    pub compared_m: f64,
    /// That of it where the other looks through.
    pub contradicted_m: f64,
    /// How many pieces that is.
    pub pieces: usize,
    /// Where the compared surface is, and how much of it, metres.
    pub spread: Vec<(Vector2<f64>, f64)>,
    /// The middle of what is confirmed in each square that tells where it is.
    pub squares: Vec<Vector2<f64>>,
}

/// Votes on a cell's surface, and its normal.
#[derive(Clone, Copy, Debug, Default)]
struct Votes {
    confirmed: u32,
    contradicted: u32,
    normal: (f64, f64),
}

/// By cell.
type Cells = BTreeMap<SurfaceCell, Votes>;

/// A surface's cell, whether it is confirmed, its normal.
type Answer = (SurfaceCell, bool, (f64, f64));

/// A square's surface, metres: confirmed, contradicted, the second moments of the confirmed
/// normals, and the sum of positions.
#[derive(Clone, Copy, Debug, Default)]
struct Square {
    confirmed: f64,
    contradicted: f64,
    moments: [f64; 3],
    sum: Vector2<f64>,
}

impl CommonGround {
    /// Compares the surroundings of places with what the other side shows there; `keep` says which
    /// patches belong to the side of a place (true) or to the other's.
    pub fn of(
        map: &Map,
        grid: &PatchGrid,
        of_island: &[u32],
        seen: &[Seen],
        keep: impl Fn(&Seen, PatchId, bool) -> bool + Sync,
    ) -> CommonGround {
        let step = seen.len().div_ceil(MOST_PLACES).max(1);
        let seen: Vec<&Seen> = seen.iter().step_by(step).collect();
        let levels = levels(map, &seen);
        let compared: Vec<Vec<Answer>> = seen
            .par_iter()
            .zip(levels)
            .map_init(
                || (Surroundings::default(), Surroundings::default()),
                |(here, there), (s, level)| {
                    here.lay(map, grid, of_island[s.place.index()], s.place, |p| keep(s, p, true));
                    there.lay(map, grid, of_island[s.from.index()], s.from, |p| keep(s, p, false));
                    let common = map.pose(s.place);
                    let back = s.from_place.inverse();
                    let to_places = (level, 0, s.doubt);
                    let mut said = answers(to_places, here, there, &s.from_place, &common);
                    let to_others = (level, 1, s.doubt);
                    said.extend(answers(to_others, there, here, &back, &(common * back)));
                    said
                },
            )
            .collect();
        let mut cells = Cells::new();
        for (key, confirmed, normal) in compared.into_iter().flatten() {
            let votes = cells.entry(key).or_default();
            *(if confirmed { &mut votes.confirmed } else { &mut votes.contradicted }) += 1;
            votes.normal = normal;
        }
        CommonGround::counted(&cells)
    }

    fn counted(cells: &Cells) -> CommonGround {
        let mut ground = CommonGround::default();
        let mut squares: BTreeMap<(i32, i32), Square> = BTreeMap::new();
        // Either side has every surface once.
        let share_m = 0.5 * CELL_M;
        for (&(_, _, u, v), votes) in cells {
            let middle = |i: i32| (f64::from(i) + 0.5) * CELL_M;
            let key = |i: i32| (middle(i) / SQUARE_M).floor() as i32;
            let square = squares.entry((key(u), key(v))).or_default();
            ground.compared_m += share_m;
            if votes.is_contradicted() {
                ground.contradicted_m += share_m;
                square.contradicted += share_m;
            } else {
                let (nx, ny) = votes.normal;
                square.confirmed += share_m;
                square.sum += Vector2::new(middle(u), middle(v)) * share_m;
                for (moment, value) in square.moments.iter_mut().zip([nx * nx, nx * ny, ny * ny]) {
                    *moment += share_m * value;
                }
            }
        }
        let contradicted = cells.iter().filter(|(_, votes)| votes.is_contradicted());
        ground.pieces = pieces_of(contradicted.map(|(&cell, _)| cell).collect(), CELL_M);
        ground.spread = spread(cells, share_m);
        let telling = squares.values().filter(|s| s.tells());
        ground.squares = telling.map(|s| s.sum / s.confirmed).collect();
        ground
    }
}

impl Votes {
    fn is_contradicted(&self) -> bool {
        self.contradicted > self.confirmed
    }
}

/// Where surface is, each cell of `share_m`.
fn spread(cells: &Cells, share_m: f64) -> Vec<(Vector2<f64>, f64)> {
    let mut squares: BTreeMap<(i32, i32), f64> = BTreeMap::new();
    for (_, _, u, v) in cells.keys() {
        let key = (u.div_euclid(SPREAD_CELLS), v.div_euclid(SPREAD_CELLS));
        *squares.entry(key).or_default() += share_m;
    }
    let middle = |i: i32| (f64::from(i) + 0.5) * f64::from(SPREAD_CELLS) * CELL_M;
    squares.into_iter().map(|((u, v), m)| (Vector2::new(middle(u), middle(v)), m)).collect()
}

impl Square {
    /// True when what is confirmed fits at no other place nearby: surfaces face more than one way.
    fn tells(&self) -> bool {
        let [xx, xy, yy] = self.moments;
        let half = 0.5 * (xx + yy);
        let weaker = half - (half * half - (xx * yy - xy * xy)).max(0.0).sqrt();
        weaker >= TELLING_M && self.contradicted < DOUBTED_M
    }
}

/// For every place the first one on its level.
fn levels(map: &Map, seen: &[&Seen]) -> Vec<PatchId> {
    let mut firsts: Vec<PatchId> = Vec::new();
    let level = |seen: &&Seen| {
        let known = firsts.iter().find(|first| !map.manifold.apart_in_height(**first, seen.place));
        known.copied().unwrap_or_else(|| {
            firsts.push(seen.place);
            seen.place
        })
    };
    seen.iter().map(level).collect()
}

/// What the other side says to every surface of one: cells in the places' island frame.
fn answers(
    (level, side, doubt): (PatchId, u8, Doubt),
    own: &Surroundings,
    other: &Surroundings,
    other_from_own: &Pose2,
    common_from_own: &Pose2,
) -> Vec<Answer> {
    let (to_other, to_common) =
        (LinePoint::mover(other_from_own), LinePoint::mover(common_from_own));
    let key = |v: f32| (f64::from(v) / CELL_M).floor() as i32;
    own.surfaces()
        .filter_map(|p| {
            let (there, common) = (to_other(&p), to_common(&p));
            let confirmed = other.shows(&there, doubt)?;
            let normal = (f64::from(common.nx), f64::from(common.ny));
            Some(((level, side, key(common.x), key(common.y)), confirmed, normal))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mapper, SlamConfig};
    use synthetic::two_loop_building;

    /// What patches of even and of odd number show of the same ground, the odd ones' pushed aside.
    fn halves(map: &Map, aside: Pose2) -> CommonGround {
        let islands = map.manifold.component_map();
        let grid = PatchGrid::new(map, &islands, 4.0);
        let patches = map.manifold.patches();
        let seen: Vec<Seen> = patches
            .windows(2)
            .filter(|pair| pair[0].id.0.is_multiple_of(2))
            .map(|pair| {
                let (place, from) = (pair[0].id, pair[1].id);
                let from_place = map.pose(from).between(&map.pose(place)) * aside;
                Seen { place, from, from_place, doubt: Doubt::NONE }
            })
            .collect();
        let of_half = |_: &Seen, patch: PatchId, even: bool| patch.0.is_multiple_of(2) == even;
        CommonGround::of(map, &grid, &islands.of, &seen, of_half)
    }

    #[test]
    fn the_same_ground_is_confirmed_and_another_contradicted() {
        let mut mapper = Mapper::new(SlamConfig::default());
        for observation in two_loop_building(1).observations.into_iter().take(150) {
            mapper.step(observation);
        }
        let same = halves(&mapper.map, Pose2::IDENTITY);
        assert!(same.compared_m > 30.0, "{same:?}");
        assert!(same.contradicted_m < 0.005 * same.compared_m, "{same:?}");
        assert!(same.pieces == 0 && same.squares.len() >= 4, "{same:?}");
        let spread: f64 = same.spread.iter().map(|(_, m)| m).sum();
        assert!((spread - same.compared_m).abs() < 1e-6, "{same:?}");
        let aside = halves(&mapper.map, Pose2::new(0.7, 0.7, 0.0));
        assert!(aside.contradicted_m > 0.05 * aside.compared_m, "{aside:?}");
        assert!(aside.pieces as f64 > 0.1 * aside.compared_m, "{aside:?}");
        assert!(aside.squares.len() < same.squares.len(), "{aside:?}");
    }
}
