use crate::wing::{End, RoomStyle, Rows, Section, Seeds, Wing, between, wing};
use crate::{Site, TwinFamily, TwinPart};
use geometry::Pose2;
use rand::{Rng, rngs::StdRng};
use std::f64::consts::PI;
use std::ops::Range;

/// Two buildings far apart that look alike in part.
pub(crate) struct TwinWorld {
    pub site: Site,
    pub buildings: [Building; 2],
    pub part: TwinPart,
}

/// What a robot may drive to in one building.
pub(crate) struct Building {
    pub stops: Range<usize>,
    /// Ends of the corridor in the part that looks alike.
    pub corridor: (usize, usize),
    /// The way around the first room of that part.
    pub room: Vec<usize>,
}

/// A building in its own frame.
struct Draft {
    wing: Wing,
    /// The section that looks alike.
    section: usize,
    along: (f64, f64),
}

/// The second building's distance; both are at most 100 m long, metres.
const APART: f64 = 130.0;

/// Draws two buildings.
pub(crate) fn twin_world(family: TwinFamily, rng: &mut StdRng) -> TwinWorld {
    let exact = rng.random::<f64>() < 0.5;
    let (drafts, mirrored) = match family {
        TwinFamily::Rooms => (rooms(exact, rng), false),
        TwinFamily::Corridors => (corridors(exact, rng), false),
        TwinFamily::Mirrored if rng.random::<bool>() => (mirror_images(exact, rng), true),
        TwinFamily::Mirrored => return half_turns(rng),
    };
    assemble(drafts, exact, mirrored, rng)
}

fn assemble(drafts: [Draft; 2], exact: bool, mirrored: bool, rng: &mut StdRng) -> TwinWorld {
    let world_from_building = [Pose2::IDENTITY, second_pose(rng)];
    let mut site = Site::default();
    let along = [drafts[0].along, drafts[1].along];
    let mut number = 0;
    let buildings = drafts.map(|draft| {
        let (corridor, room) = draft.alike();
        let own =
            if mirrored && number == 1 { draft.wing.site.mirrored() } else { draft.wing.site };
        let first = site.append(own.placed(&world_from_building[number]));
        number += 1;
        Building {
            stops: first..site.stops.len(),
            corridor: (corridor.0 + first, corridor.1 + first),
            room: room.iter().map(|stop| stop + first).collect(),
        }
    });
    TwinWorld { site, buildings, part: TwinPart { exact, mirrored, world_from_building, along } }
}

fn second_pose(rng: &mut StdRng) -> Pose2 {
    Pose2::new(0.0, -APART, between(rng, (-PI, PI)))
}

impl Draft {
    /// Ends of the corridor and the first room's way in the section that looks alike.
    fn alike(&self) -> ((usize, usize), Vec<usize>) {
        let site = &self.wing.site;
        let inside = |stop: &&usize| (self.along.0..=self.along.1).contains(&site.stops[**stop].0);
        let mut corridor: Vec<usize> = self.wing.corridor.iter().filter(inside).copied().collect();
        if corridor.is_empty() {
            // A short section may lie between two stops.
            let middle = 0.5 * (self.along.0 + self.along.1);
            let off = |stop: &usize| (site.stops[*stop].0 - middle).abs();
            let stops = self.wing.corridor.iter().copied();
            corridor.extend(stops.min_by(|a, b| off(a).total_cmp(&off(b))));
        }
        let room = self.wing.rooms.iter().find(|(section, _)| *section == self.section);
        let ends = (corridor[0], corridor[corridor.len() - 1]);
        (ends, room.map(|(_, stops)| stops.clone()).unwrap_or_default())
    }
}

fn seeds(rng: &mut StdRng) -> Seeds {
    Seeds { walls: rng.random(), doors: rng.random(), furniture: rng.random() }
}

/// The same walls; doors and furniture too if `exact`.
fn copied(section: Section, exact: bool, rng: &mut StdRng) -> Section {
    let drawn = Seeds { walls: section.seeds.walls, ..seeds(rng) };
    Section { seeds: if exact { section.seeds } else { drawn }, ..section }
}

/// Rooms of a kind of their own.
fn surroundings(length: (f64, f64), rng: &mut StdRng) -> Section {
    let width = between(rng, (3.2, 6.0));
    let depth = between(rng, (3.5, 6.0));
    let rooms = RoomStyle { width: (width, width + 2.0), depth: (depth, depth + 1.0), shut: 0.3 };
    let rows = if rng.random::<f64>() < 0.7 { Rows::Both } else { Rows::North };
    Section { length: between(rng, length), rows, rooms, seeds: seeds(rng) }
}

/// Some surroundings, a part that looks alike (several times perhaps), other surroundings.
fn between_surroundings(
    width: f64,
    alike: &[Section],
    length: (f64, f64),
    rng: &mut StdRng,
) -> Draft {
    let mut sections = vec![surroundings(length, rng)];
    sections.extend_from_slice(alike);
    sections.push(surroundings(length, rng));
    let start = sections[0].length;
    Draft {
        wing: wing(width, &sections, [End::Wall, End::Wall]),
        section: 1,
        along: (start, start + alike[0].length),
    }
}

/// A room, one to three times in each building.
fn rooms(exact: bool, rng: &mut StdRng) -> [Draft; 2] {
    let width = between(rng, (2.2, 2.8));
    let room = (between(rng, (5.5, 8.0)), between(rng, (5.0, 7.0)));
    let rooms = RoomStyle { width: (room.0, room.0), depth: (room.1, room.1), shut: 0.0 };
    let section = Section { length: room.0, rows: Rows::North, rooms, seeds: seeds(rng) };
    [(); 2].map(|()| {
        let count = rng.random_range(1..=3);
        let alike: Vec<Section> = (0..count).map(|_| copied(section, exact, rng)).collect();
        between_surroundings(width, &alike, (8.0, 25.0), rng)
    })
}

/// A corridor: copied with all that is in it, but no longer than 20 m; or its walls alone.
fn corridors(exact: bool, rng: &mut StdRng) -> [Draft; 2] {
    let width = between(rng, (2.2, 2.8));
    let length = if exact { (10.0, 20.0) } else { (18.0, 45.0) };
    let section = surroundings(length, rng);
    [(); 2].map(|()| {
        let alike = copied(section, exact, rng);
        between_surroundings(width, &[alike], (6.0, 20.0), rng)
    })
}

/// A building without anything else around.
fn mirror_images(exact: bool, rng: &mut StdRng) -> [Draft; 2] {
    let width = between(rng, (2.2, 2.8));
    let section = surroundings((18.0, 45.0), rng);
    let sections = [section, copied(section, exact, rng)];
    sections.map(|section| Draft {
        wing: wing(width, &[section], [End::Wall, End::Wall]),
        section: 0,
        along: (0.0, section.length),
    })
}

/// Two buildings of the same plan, which half a turn brings nearly onto itself: each half has the
/// same walls but at its end. Doors and furniture are drawn anew.
fn half_turns(rng: &mut StdRng) -> TwinWorld {
    let width = between(rng, (2.2, 2.8));
    let half = Section { rows: Rows::Both, ..surroundings((12.0, 22.0), rng) };
    let mut site = Site::default();
    let world_from_building = [Pose2::IDENTITY, second_pose(rng)];
    let buildings = [0, 1].map(|number| {
        let first = site.stops.len();
        let ends = [false, true].map(|turned| {
            let sections = [surroundings((4.0, 8.0), rng), copied(half, false, rng)];
            let part = wing(width, &sections, [End::Wall, End::Open]);
            // The building's origin is its middle.
            let length = sections[0].length + sections[1].length;
            let building_from_half = match turned {
                false => Pose2::new(-length, 0.0, 0.0),
                true => Pose2::new(length, 0.0, PI),
            };
            let placed = part.site.placed(&(world_from_building[number] * building_from_half));
            let offset = site.append(placed);
            (part.corridor[0] + offset, part.corridor[part.corridor.len() - 1] + offset)
        });
        site.chain(&[ends[0].1, ends[1].1]);
        Building {
            stops: first..site.stops.len(),
            corridor: (ends[0].0, ends[1].0),
            room: Vec::new(),
        }
    });
    let along = [(-half.length, half.length); 2];
    let part = TwinPart { exact: false, mirrored: false, world_from_building, along };
    TwinWorld { site, buildings, part }
}
