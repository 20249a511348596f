use crate::Site;
use crate::buildings::furnish;
use rand::{Rng, SeedableRng, rngs::StdRng};

/// What each part of a section is drawn from, so that copies may share some of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seeds {
    pub walls: u64,
    pub doors: u64,
    pub furniture: u64,
}

/// Which sides of the corridor have rooms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Rows {
    Both,
    North,
}

/// Rooms along a corridor, metres; limits of uniform distributions. At least 3 m both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RoomStyle {
    pub width: (f64, f64),
    pub depth: (f64, f64),
    /// Share of doors that are shut.
    pub shut: f64,
}

/// A stretch of corridor with its rooms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Section {
    pub length: f64,
    pub rows: Rows,
    pub rooms: RoomStyle,
    pub seeds: Seeds,
}

/// How a corridor ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    Wall,
    /// A door to a stop outside.
    Door,
    Open,
}

/// A corridor with rooms on both sides. It runs along x from 0, its middle is y = 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wing {
    pub site: Site,
    /// Stops along the corridor by x, those outside the doors at its ends included.
    pub corridor: Vec<usize>,
    /// Stops in each room that can be entered, by section.
    pub rooms: Vec<(usize, Vec<usize>)>,
}

/// Half the thickness of walls, metres.
const HALF: f64 = 0.06;
/// Stops keep this distance from walls, metres.
const INSET: f64 = 0.9;
/// A facade stands this far behind the rooms' back walls: niches go into it, metres.
const FACADE: f64 = 0.6;

/// Draws a wing.
pub(crate) fn wing(width: f64, sections: &[Section], ends: [End; 2]) -> Wing {
    let mut draft = Draft { width, wing: Wing::default(), doors: Vec::new() };
    let mut x = 0.0;
    for (index, section) in sections.iter().enumerate() {
        for north in [true, false] {
            draft.row(index, section, x, north);
        }
        draft.cupboards(section, x);
        x += section.length;
    }
    draft.corridor(x, ends);
    draft.wing
}

struct Draft {
    width: f64,
    wing: Wing,
    /// Along x and on the north side or not.
    doors: Vec<(f64, bool)>,
}

/// Sources of one row's random choices.
struct Sources {
    walls: StdRng,
    doors: StdRng,
    furniture: StdRng,
}

impl Draft {
    /// The rooms on one side of a section, or a plain wall.
    fn row(&mut self, index: usize, section: &Section, start: f64, north: bool) {
        let end = start + section.length;
        let y = if north { 0.5 } else { -0.5 } * self.width;
        if section.rows == Rows::North && !north {
            self.wing.site.plan.partition((start, y), (end, y), &[]);
            return;
        }
        let source =
            |seed: u64| StdRng::seed_from_u64(seed.wrapping_mul(2).wrapping_add(u64::from(north)));
        let Seeds { walls, doors, furniture } = section.seeds;
        let mut sources =
            Sources { walls: source(walls), doors: source(doors), furniture: source(furniture) };
        let mut x = start;
        while x < end - 1e-6 {
            let mut next = x + between(&mut sources.walls, section.rooms.width);
            if end - next < section.rooms.width.0 {
                next = end;
            }
            self.room(index, &section.rooms, (x, next), north, &mut sources);
            x = next;
        }
    }

    /// One room with its door, a niche in the back wall, and furniture.
    fn room(
        &mut self,
        section: usize,
        style: &RoomStyle,
        (x0, x1): (f64, f64),
        north: bool,
        sources: &mut Sources,
    ) {
        let side = if north { 1.0 } else { -1.0 };
        let y = side * 0.5 * self.width;
        let depth = between(&mut sources.walls, style.depth);
        let (front, back) = (y + side * HALF, y + side * (HALF + depth));
        let door = between(&mut sources.walls, (x0 + INSET + HALF, x1 - INSET - HALF));
        let opening = between(&mut sources.walls, (1.0, 1.2));
        let (left, right) = (x0 + HALF, x1 - HALF);
        let niche = between(&mut sources.walls, (left + 0.3, right - 1.6));
        let (niche_end, niche_back) = (
            niche + between(&mut sources.walls, (0.5, 1.2)),
            back + side * between(&mut sources.walls, (0.15, 0.5)),
        );
        let plan = &mut self.wing.site.plan;
        plan.partition((x0, y), (x1, y), &[(door - 0.5 * opening - x0, opening)]);
        plan.polyline(&[
            (left, front),
            (left, back),
            (niche, back),
            (niche, niche_back),
            (niche_end, niche_back),
            (niche_end, back),
            (right, back),
            (right, front),
        ]);
        plan.wall((x0, back + side * FACADE), (x1, back + side * FACADE));
        self.doors.push((door, north));
        let shut = sources.doors.random::<f64>() < style.shut;
        if shut {
            plan.wall((door - 0.5 * opening, y), (door + 0.5 * opening, y));
        }
        let ring = [
            (door, front + side * INSET),
            (right - INSET, front + side * INSET),
            (right - INSET, back - side * INSET),
            (left + INSET, back - side * INSET),
            (left + INSET, front + side * INSET),
            (door, front + side * INSET),
            (door, 0.0),
        ];
        let low = (left + 0.3, front.min(back) + 0.3);
        let high = (right - 0.3, front.max(back) - 0.3);
        furnish(plan, &mut sources.furniture, low, high, &ring);
        if !shut {
            self.ways_of_room(section, &ring);
        }
    }

    /// Around the room and out of its door to the middle of the corridor.
    fn ways_of_room(&mut self, section: usize, ring: &[(f64, f64); 7]) {
        let site = &mut self.wing.site;
        let stops: Vec<usize> = ring[..5].iter().map(|&at| site.stop(at)).collect();
        let outside = site.stop(ring[6]);
        site.chain(&stops);
        site.chain(&[stops[4], stops[0], outside]);
        self.wing.rooms.push((section, stops));
        self.wing.corridor.push(outside);
    }

    /// Cupboards against the corridor's walls, about one in six metres, not before doors.
    fn cupboards(&mut self, section: &Section, start: f64) {
        let rng = &mut StdRng::seed_from_u64(section.seeds.furniture ^ 0xC0FF_EE00);
        for _ in 0..(section.length / 6.0).round() as usize {
            let x = start + rng.random_range(0.0..section.length);
            let (length, north) = (rng.random_range(0.5..1.2), rng.random::<bool>());
            let side = if north { 1.0 } else { -1.0 };
            let clear = self.doors.iter().all(|&(door, of_north)| {
                of_north != north || (door - x).abs() > 0.5 * length + 0.9
            });
            let inside = x - start > 1.0 && start + section.length - x > 1.0;
            if clear && inside {
                let y = side * (0.5 * self.width - HALF - 0.15);
                self.wing.site.plan.block((x, y), (length, 0.3), 0.0);
            }
        }
    }

    /// The corridor's ends, and the way from end to end.
    fn corridor(&mut self, length: f64, ends: [End; 2]) {
        let half = 0.5 * self.width;
        let site = &mut self.wing.site;
        for (end, x, inwards) in [(ends[0], 0.0, 1.0), (ends[1], length, -1.0)] {
            match end {
                End::Wall => site.plan.wall((x, -half), (x, half)),
                End::Door => site.plan.partition((x, -half), (x, half), &[(half - 0.6, 1.2)]),
                End::Open => &mut site.plan,
            };
            if end == End::Door {
                self.wing.corridor.push(site.stop((x - inwards, 0.0)));
            }
            let inset = if end == End::Open { 0.0 } else { INSET };
            self.wing.corridor.push(site.stop((x + inwards * inset, 0.0)));
        }
        let along = |stop: &usize| site.stops[*stop].0;
        self.wing.corridor.sort_by(|a, b| along(a).total_cmp(&along(b)));
        let corridor = self.wing.corridor.clone();
        site.chain(&corridor);
    }
}

/// A sample between two limits, which may be the same.
pub(crate) fn between(rng: &mut StdRng, (low, high): (f64, f64)) -> f64 {
    low + (high - low) * rng.random::<f64>()
}
