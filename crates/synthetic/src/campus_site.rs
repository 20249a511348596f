use crate::Site;
use crate::campus_parts::{Junction, hall, junction, offices, passage};
use crate::wing::between;
use rand::{Rng, SeedableRng, rngs::StdRng};
use std::collections::BTreeMap;
use std::ops::Range;

/// Buildings in rows and columns: junctions stand on a lattice, a building lies between each and
/// the next along x, a passage between each and the next along y.
#[derive(Clone, Debug, Default)]
pub(crate) struct CampusSite {
    pub site: Site,
    /// The buildings, row by row.
    pub buildings: Vec<CampusBuilding>,
    columns: usize,
}

/// Where robots may drive in a building.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CampusBuilding {
    pub stops: Range<usize>,
    /// Those at its two ends.
    pub ends: (usize, usize),
}

/// A place of the lattice: column and row.
type Place = (usize, usize);

/// Distances of the lattice along x and y, metres.
const PITCH: (f64, f64) = (56.0, 32.0);

impl CampusSite {
    /// Draws a campus of so many buildings, one at least. What stands at a place depends on it and
    /// the seed.
    pub(crate) fn new(seed: u64, buildings: usize) -> Self {
        let columns = ((buildings as f64).sqrt().ceil() as usize).max(1);
        let mut campus = CampusSite { columns, ..CampusSite::default() };
        let places: Vec<Place> =
            (0..buildings.max(1)).map(|k| (k % columns, k / columns)).collect();
        // Each building has a junction at either end.
        let mut junctions: BTreeMap<Place, Junction> = BTreeMap::new();
        let is_junction = |(column, row): Place| {
            places.contains(&(column, row)) || column > 0 && places.contains(&(column - 1, row))
        };
        for &(column, row) in &places {
            for place in [(column, row), (column + 1, row)] {
                let at = (PITCH.0 * place.0 as f64, PITCH.1 * row as f64);
                let open = [
                    places.contains(&place),
                    is_junction((place.0, row + 1)),
                    place.0 > 0 && places.contains(&(place.0 - 1, row)),
                    row > 0 && is_junction((place.0, row - 1)),
                ];
                let rng = &mut source(seed, 1, place);
                let site = &mut campus.site;
                junctions.entry(place).or_insert_with(|| junction(site, rng, at, open));
            }
        }
        for (&(column, row), south) in &junctions {
            if let Some(north) = junctions.get(&(column, row + 1)) {
                let rng = &mut source(seed, 2, (column, row));
                passage(&mut campus.site, rng, south.doors[1], north.doors[3]);
            }
        }
        for (column, row) in places {
            let (west, east) = (junctions[&(column, row)], junctions[&(column + 1, row)]);
            campus.build(&mut source(seed, 3, (column, row)), [west.doors[0], east.doors[2]]);
        }
        campus
    }

    /// A building between two junctions' doors, and the passages to them.
    fn build(&mut self, rng: &mut StdRng, doors: [usize; 2]) {
        let [west, east] = doors.map(|stop| self.site.stops[stop]);
        let margins = [(); 2].map(|()| between(rng, (2.5, 5.0)));
        let length = east.0 - west.0 - margins[0] - margins[1];
        let origin = (west.0 + margins[0], west.1);
        let first = self.site.stops.len();
        let ends = match rng.random_range(0..4) {
            0 => hall(&mut self.site, rng, origin, length),
            kind => offices(&mut self.site, rng, origin, length, kind == 1),
        };
        let stops = first..self.site.stops.len();
        passage(&mut self.site, rng, doors[0], ends.0);
        passage(&mut self.site, rng, ends.1, doors[1]);
        self.buildings.push(CampusBuilding { stops, ends });
    }

    /// The buildings around one: east, north, west, south.
    pub(crate) fn neighbours(&self, number: usize) -> Vec<&CampusBuilding> {
        let (column, row) = (number % self.columns, number / self.columns);
        let at = |column: usize, row: usize| {
            (column < self.columns).then(|| self.buildings.get(row * self.columns + column))?
        };
        let west = column.checked_sub(1).and_then(|column| at(column, row));
        let south = row.checked_sub(1).and_then(|row| at(column, row));
        [at(column + 1, row), at(column, row + 1), west, south].into_iter().flatten().collect()
    }
}

/// What one thing of the campus is drawn from.
fn source(seed: u64, kind: u64, (column, row): Place) -> StdRng {
    let place = ((row as u64) << 24) | ((column as u64) << 8) | kind;
    // The golden ratio in 64 bits scatters small numbers (Knuth 1998, section 6.4).
    StdRng::seed_from_u64(seed ^ place.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}
