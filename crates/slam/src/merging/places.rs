use crate::loop_closing::{Signature, signature_of};
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use manifold::{Islands, PatchId, SubmapLimits};
use rayon::prelude::*;

/// A place of an island: a patch with the look of its surroundings.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub patch: PatchId,
    pub island: u32,
    look: Look,
}

/// Bytes of a look: the rings and harmonics of a [`Signature`].
const LOOK_BYTES: usize = Signature::VALUES;

/// A [`Signature`] in bytes: 40 of them tell places apart as well as 40 floats, and a hundred
/// thousand of them are compared in a fraction of a millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Look([u8; LOOK_BYTES]);

impl Look {
    fn of(signature: &Signature) -> Self {
        // Components of a unit vector of magnitudes; half is hardly ever exceeded.
        Look(signature.values().map(|v| (v * 510.0).round().clamp(0.0, 255.0) as u8))
    }

    /// Squared distance of two looks.
    fn distance2(&self, other: &Look) -> u32 {
        self.0.iter().zip(&other.0).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum()
    }
}

/// All islands' places by their look.
#[derive(Clone, Debug, Default)]
pub(super) struct PlaceIndex {
    pub places: Vec<Place>,
    /// How many of them each island has.
    counts: Vec<usize>,
}

impl PlaceIndex {
    /// Places at least `spacing_m` apart on every island, in the order of their patches.
    pub fn new(map: &Map, islands: &Islands, limits: &SubmapLimits, spacing_m: f64) -> Self {
        let chosen = spaced_patches(map, islands, spacing_m);
        let place = |&patch: &PatchId| Place {
            patch,
            island: islands.of[patch.index()],
            look: Look::of(&signature_of(patch, map, limits)),
        };
        let places: Vec<Place> = chosen.par_iter().map(place).collect();
        let mut counts = vec![0; islands.members.len()];
        places.iter().for_each(|p| counts[p.island as usize] += 1);
        PlaceIndex { places, counts }
    }

    /// How many times as many places look like one by accident on the largest other island as on
    /// one of about its own island's size.
    pub fn crowding(&self, query: &Place) -> usize {
        let others = self.counts.iter().enumerate().filter(|(i, _)| *i as u32 != query.island);
        let largest = others.map(|(_, count)| *count).max().unwrap_or(0);
        (largest / (MUCH_LARGER * self.counts[query.island as usize])).max(1)
    }

    /// The `most` places on other islands that look most like a place, best first, those of one
    /// island at least `apart_m` from each other. A place is not looked for on much smaller
    /// islands.
    pub fn alike(&self, map: &Map, query: &Place, most: usize, apart_m: f64) -> Vec<Place> {
        let count = |place: &Place| self.counts[place.island as usize];
        let is_asked = |other: &Place| {
            other.island != query.island && count(query) < MUCH_LARGER * count(other)
        };
        let others = self.places.iter().enumerate().filter(|(_, p)| is_asked(p));
        let mut ranked: Vec<(u32, usize)> =
            others.map(|(i, p)| (p.look.distance2(&query.look), i)).collect();
        // Enough to choose from; the rest need not be sorted.
        let enough = (most * CHOICE).min(ranked.len());
        if enough < ranked.len() {
            ranked.select_nth_unstable(enough);
            ranked.truncate(enough);
        }
        ranked.sort_unstable();
        let mut chosen: Vec<Place> = Vec::with_capacity(most);
        for (_, index) in ranked {
            let place = self.places[index];
            let own = map.pose(place.patch);
            let near = |other: &Place| {
                other.island == place.island
                    && map.pose(other.patch).distance(&own) < apart_m
                    && !map.manifold.apart_in_height(other.patch, place.patch)
            };
            if !chosen.iter().any(near) {
                chosen.push(place);
            }
            if chosen.len() >= most {
                break;
            }
        }
        chosen
    }
}

/// Where one of two islands has so many times the other's places, the smaller one's are looked for
/// on the larger one and not the other way round: what is compared is bounded by what is left to be
/// joined.
const MUCH_LARGER: usize = 4;
/// Of so many times as many places as wanted those too near to a better one are left out.
const CHOICE: usize = 4;

/// Patches at least `spacing_m` from each other on every island, the earliest first. A ramp is no
/// place: its walls repeat.
pub(super) fn spaced_patches(map: &Map, islands: &Islands, spacing_m: f64) -> Vec<PatchId> {
    let near = PatchGrid::new(map, islands, spacing_m);
    let mut taken = vec![false; map.manifold.patches().len()];
    let mut chosen = Vec::new();
    for patch in map.manifold.patches().iter().filter(|p| !p.left_out && map.is_level(p.id)) {
        let island = islands.of[patch.id.index()];
        let around = near.within(map, island, &patch.island_from_patch, spacing_m);
        let beside = |p: &PatchId| !map.manifold.apart_in_height(*p, patch.id);
        if around.iter().any(|p| taken[p.index()] && beside(p)) {
            continue;
        }
        taken[patch.id.index()] = true;
        chosen.push(patch.id);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_a_much_larger_island_more_places_look_alike() {
        let index = PlaceIndex { counts: vec![10, 12, 39, 130], ..PlaceIndex::default() };
        let crowding = |island: u32| {
            let look = Look([0; LOOK_BYTES]);
            index.crowding(&Place { patch: PatchId(0), island, look })
        };
        assert_eq!([0, 1, 2, 3].map(crowding), [3, 2, 1, 1]);
    }
}
