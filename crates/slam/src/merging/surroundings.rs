use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{Pose2, Vector2};
use manifold::PatchId;
use matching::LinePoint;

/// Side of a cell, metres.
const CELL_M: f32 = 0.15;
/// How far from the place surfaces are known, metres: what most lasers see of a corridor.
const REACH_M: f32 = 20.0;
/// Cells along either axis: twice the reach.
const SIDE: usize = 267;
/// Patches so far around the place are looked at, metres, ...
const RADIUS_M: f64 = 6.0;
/// ... the nearest ones ...
const MOST_PATCHES: usize = 12;
/// ... that lie so far from each other, metres or radians.
const SPACING: f64 = 0.4;
/// A sight line is followed up to so far before its end, metres: walls are met at a slant.
const BEFORE_END_M: f32 = 0.4;
/// A surface was seen, and a place looked through, from so many patches: who walks by is seen from
/// one.
const WITNESSES: u8 = 2;
/// Surfaces nearer to each other than this are the same one: metres, and per metre from the place,
/// as yaws are known to a degree.
const SAME_M: f32 = 0.25;
const SAME_PER_M: f32 = 0.015;

/// What some patches show around a place: by cell, from how many of them a surface was seen there
/// and from how many one looked through.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    cells: Vec<Cell>,
    surfaces: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    hits: u8,
    passes: u8,
    /// The patches that hit it and passed it last, counted from one: each counts once.
    last_hit: u8,
    last_pass: u8,
    nx: f32,
    ny: f32,
}

impl Default for Surroundings {
    fn default() -> Self {
        Surroundings { cells: vec![Cell::default(); SIDE * SIDE], surfaces: Vec::new() }
    }
}

impl Surroundings {
    /// Lays what the patches around a place show, in the place's frame; those on its level that
    /// `keep` accepts.
    pub fn lay(
        &mut self,
        map: &Map,
        grid: &PatchGrid,
        island: u32,
        place: PatchId,
        keep: impl Fn(PatchId) -> bool,
    ) {
        self.cells.fill(Cell::default());
        let own = map.pose(place);
        let mut near = grid.within(map, island, &own, RADIUS_M);
        near.retain(|&patch| keep(patch) && map.comparable(place, patch));
        for (number, patch) in spaced(map, near, &own).into_iter().enumerate() {
            self.add(map, patch, &own.between(&map.pose(patch)), number as u8 + 1);
        }
        let is_surface = |cell: &Cell| cell.hits >= WITNESSES && cell.passes <= cell.hits;
        let surfaces = self.cells.iter().enumerate().filter(|(_, cell)| is_surface(cell));
        self.surfaces = surfaces.map(|(index, _)| index as u32).collect();
    }

    /// The surfaces, as points in the place's frame.
    pub fn surfaces(&self) -> impl Iterator<Item = LinePoint> + '_ {
        let centre = |i: usize| (i as f32 + 0.5) * CELL_M - REACH_M;
        self.surfaces.iter().map(move |&index| {
            let (index, cell) = (index as usize, self.cells[index as usize]);
            LinePoint {
                x: centre(index % SIDE),
                y: centre(index / SIDE),
                nx: cell.nx,
                ny: cell.ny,
                variance: 0.0,
                normal_variance: 0.0,
            }
        })
    }

    /// True where a surface is at a point or next to it, false where one looks through all around
    /// it, `None` where neither is known.
    pub fn shows(&self, x: f32, y: f32) -> Option<bool> {
        let (u, v) = (index_of(x)?, index_of(y)?);
        let same = SAME_M + SAME_PER_M * x.hypot(y);
        let reach = (same / CELL_M).ceil() as usize;
        if u.min(v) < reach || u.max(v) + reach >= SIDE {
            return None;
        }
        let row = |v: usize, reach: usize| &self.cells[v * SIDE + u - reach..=v * SIDE + u + reach];
        if (v - reach..=v + reach).any(|v| row(v, reach).iter().any(|c| c.hits > 0)) {
            return Some(true);
        }
        let free = (v - 1..=v + 1).all(|v| row(v, 1).iter().all(|c| c.passes > 0));
        (free && self.cells[v * SIDE + u].passes >= WITNESSES).then_some(false)
    }

    fn add(&mut self, map: &Map, patch: PatchId, place_from_patch: &Pose2, number: u8) {
        let place_from_laser = *place_from_patch * map.manifold.patch(patch).base_from_laser;
        let laser = place_from_laser.translation().cast::<f32>();
        for p in map.surface(patch).iter().map(LinePoint::mover(place_from_patch)) {
            if let Some(cell) = self.cell(p.x, p.y)
                && cell.last_hit != number
            {
                *cell = Cell { hits: cell.hits + 1, last_hit: number, nx: p.nx, ny: p.ny, ..*cell };
            }
            let line = Vector2::new(p.x, p.y) - laser;
            let range = line.norm();
            let step_m = 0.7 * CELL_M;
            let steps = ((range - BEFORE_END_M).min(2.0 * REACH_M) / step_m).max(0.0) as usize;
            for step in 1..=steps {
                let at = laser + line * (step as f32 * step_m / range);
                if let Some(cell) = self.cell(at.x, at.y)
                    && cell.last_pass != number
                {
                    (cell.passes, cell.last_pass) = (cell.passes + 1, number);
                }
            }
        }
    }

    fn cell(&mut self, x: f32, y: f32) -> Option<&mut Cell> {
        let index = index_of(y)? * SIDE + index_of(x)?;
        self.cells.get_mut(index)
    }
}

/// Patches apart from each other, those nearest to a pose first.
fn spaced(map: &Map, mut patches: Vec<PatchId>, around: &Pose2) -> Vec<PatchId> {
    let distance = |patch: &PatchId| map.pose(*patch).distance(around);
    patches.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
    let mut chosen: Vec<PatchId> = Vec::with_capacity(MOST_PATCHES);
    for patch in patches {
        let apart = |other: &PatchId| {
            let step = map.pose(*other).between(&map.pose(patch));
            step.norm() > SPACING || step.yaw.abs() > SPACING
        };
        if chosen.len() < MOST_PATCHES && chosen.iter().all(apart) {
            chosen.push(patch);
        }
    }
    chosen
}

fn index_of(v: f32) -> Option<usize> {
    let index = ((v + REACH_M) / CELL_M).floor();
    (index >= 0.0 && (index as usize) < SIDE).then_some(index as usize)
}
