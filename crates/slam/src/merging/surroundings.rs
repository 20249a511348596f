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
/// A sight line is followed until so near the surface that it ends at, metres across that surface:
/// what lies nearer to it may be that surface, ...
const BEFORE_SURFACE_M: f32 = 0.15;
/// ... and, where the surface is met at a slant, no nearer to the end than this, metres.
const BEFORE_END_M: f32 = 1.5;
/// A surface was seen, and a place looked through, from so many patches: who walks by is seen from
/// one.
const WITNESSES: u8 = 2;
/// Surfaces nearer to each other than this, across them, are the same one: metres, and per metre
/// from the place, as yaws are known to a degree.
const SAME_M: f32 = 0.12;
const SAME_PER_M: f32 = 0.02;
/// Along them so far, metres: beams leave gaps.
const ALONG_M: f32 = 0.35;

/// What it is off how two places lie to each other, standard deviations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    pub std_m: f32,
    pub std_rad: f32,
}

impl Doubt {
    /// The places were matched.
    pub const NONE: Doubt = Doubt { std_m: 0.0, std_rad: 0.0 };
}

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
    /// Sum of the points hit, one for each patch.
    x: f32,
    y: f32,
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
        self.surfaces.iter().map(move |&index| {
            let cell = self.cells[index as usize];
            LinePoint {
                x: cell.x / f32::from(cell.hits),
                y: cell.y / f32::from(cell.hits),
                nx: cell.nx,
                ny: cell.ny,
                variance: 0.0,
                normal_variance: 0.0,
            }
        })
    }

    /// True where a surface is where another one lies, false where one looks through there and on
    /// to something behind it, `None` where neither is known.
    pub fn shows(&self, p: &LinePoint, doubt: Doubt) -> Option<bool> {
        let (u, v) = (index_of(p.x)?, index_of(p.y)?);
        let same = SAME_M + doubt.std_m + (SAME_PER_M + doubt.std_rad) * p.x.hypot(p.y);
        let along = ALONG_M.max(same);
        let reach = (along / CELL_M).ceil() as usize;
        if u.min(v) < reach || u.max(v) + reach >= SIDE {
            return None;
        }
        let is_same = |cell: &Cell| {
            let hits = f32::from(cell.hits);
            let (dx, dy) = (cell.x / hits - p.x, cell.y / hits - p.y);
            let apart = dx.hypot(dy);
            apart <= same || apart <= along && (p.nx * dx + p.ny * dy).abs() <= same
        };
        let row = |v: usize| &self.cells[v * SIDE + u - reach..=v * SIDE + u + reach];
        if (v - reach..=v + reach).any(|v| row(v).iter().any(|c| c.hits > 0 && is_same(c))) {
            return Some(true);
        }
        (self.cells[v * SIDE + u].passes >= WITNESSES).then_some(false)
    }

    fn add(&mut self, map: &Map, patch: PatchId, place_from_patch: &Pose2, number: u8) {
        let place_from_laser = *place_from_patch * map.manifold.patch(patch).base_from_laser;
        let laser = place_from_laser.translation().cast::<f32>();
        for p in map.surface(patch).iter().map(LinePoint::mover(place_from_patch)) {
            if let Some(cell) = self.cell(p.x, p.y)
                && cell.last_hit != number
            {
                *cell = Cell {
                    hits: cell.hits + 1,
                    last_hit: number,
                    nx: p.nx,
                    ny: p.ny,
                    x: cell.x + p.x,
                    y: cell.y + p.y,
                    ..*cell
                };
            }
            let line = Vector2::new(p.x, p.y) - laser;
            let range = line.norm();
            let step_m = 0.7 * CELL_M;
            let across = (line.x * p.nx + line.y * p.ny).abs() / range;
            let before_m = (BEFORE_SURFACE_M / across).min(BEFORE_END_M);
            let steps = ((range - before_m).min(2.0 * REACH_M) / step_m).max(0.0) as usize;
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
