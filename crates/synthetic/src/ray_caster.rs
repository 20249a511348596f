use crate::{Circle, FloorPlan, Wall};
use geometry::Vector2;

/// Where a ray first meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Distance from the ray's origin, metres.
    pub range: f64,
    /// Unit normal of the surface in the world frame, towards the ray's origin.
    pub normal: Vector2<f64>,
}

/// A floor plan indexed by a uniform grid, so that a ray tests only the surfaces along its way.
#[derive(Clone, Debug)]
pub struct RayCaster {
    plan: FloorPlan,
    origin: Vector2<f64>,
    size: (usize, usize),
    /// Shapes of cell `i` are `shapes[starts[i]..starts[i + 1]]`; walls first, then circles.
    starts: Vec<u32>,
    shapes: Vec<u32>,
}

impl RayCaster {
    /// Cell size of the index, metres.
    const CELL: f64 = 0.5;

    /// Indexes a plan.
    pub fn new(plan: FloorPlan) -> Self {
        let (lo, hi) = plan.bounds();
        let origin = lo - Vector2::repeat(Self::CELL);
        let cells = |d: f64| (d / Self::CELL).floor() as usize + 3;
        let size = (cells(hi.x - lo.x), cells(hi.y - lo.y));
        let mut caster =
            RayCaster { plan, origin, size, starts: vec![0; size.0 * size.1 + 1], shapes: vec![] };
        let mut lists = vec![Vec::new(); size.0 * size.1];
        for index in 0..caster.plan.walls.len() + caster.plan.circles.len() {
            caster.for_cells_of(index, |cell| lists[cell].push(index as u32));
        }
        for (cell, list) in lists.iter().enumerate() {
            caster.shapes.extend_from_slice(list);
            caster.starts[cell + 1] = caster.shapes.len() as u32;
        }
        caster
    }

    /// The plan it was made from.
    pub fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// The first surface within `max_range` metres along the unit vector `direction`.
    pub fn cast(
        &self,
        origin: Vector2<f64>,
        direction: Vector2<f64>,
        max_range: f64,
    ) -> Option<SurfaceHit> {
        let mut walk = CellWalk::enter(self, origin, direction)?;
        let mut best: Option<SurfaceHit> = None;
        loop {
            let cell = walk.y as usize * self.size.0 + walk.x as usize;
            for &shape in &self.shapes[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
                best = nearer(best, self.hit_shape(shape as usize, origin, direction));
            }
            // A hit beyond this cell may be preceded by one in a later cell.
            if best.is_some_and(|hit| hit.range <= walk.exit()) || walk.exit() > max_range {
                break;
            }
            if !walk.step(self.size) {
                break;
            }
        }
        best.filter(|hit| hit.range <= max_range)
    }

    /// The same as [`RayCaster::cast`] by testing every surface: the oracle for it.
    pub fn cast_exhaustively(
        &self,
        origin: Vector2<f64>,
        direction: Vector2<f64>,
        max_range: f64,
    ) -> Option<SurfaceHit> {
        (0..self.plan.walls.len() + self.plan.circles.len())
            .fold(None, |best, shape| nearer(best, self.hit_shape(shape, origin, direction)))
            .filter(|hit| hit.range <= max_range)
    }

    fn hit_shape(&self, index: usize, o: Vector2<f64>, d: Vector2<f64>) -> Option<SurfaceHit> {
        match self.plan.walls.get(index) {
            Some(wall) => hit_wall(wall, o, d),
            None => hit_circle(&self.plan.circles[index - self.plan.walls.len()], o, d),
        }
    }

    /// Calls `visit` for every cell that a shape's boundary may touch.
    fn for_cells_of(&self, index: usize, mut visit: impl FnMut(usize)) {
        let (lo, hi, wall) = match self.plan.walls.get(index) {
            Some(wall) => (wall.from.inf(&wall.to), wall.from.sup(&wall.to), Some(wall)),
            None => {
                let circle = &self.plan.circles[index - self.plan.walls.len()];
                let r = Vector2::repeat(circle.radius);
                (circle.centre - r, circle.centre + r, None)
            }
        };
        // A little slack, so that rounding never leaves a touched cell out.
        let cell = |p: Vector2<f64>, slack: f64| {
            let c = (p - self.origin).add_scalar(slack) / Self::CELL;
            (c.x.max(0.0) as usize, c.y.max(0.0) as usize)
        };
        let ((x0, y0), (x1, y1)) = (cell(lo, -1e-6), cell(hi, 1e-6));
        for y in y0..=y1.min(self.size.1 - 1) {
            for x in x0..=x1.min(self.size.0 - 1) {
                let corner = self.origin + Vector2::new(x as f64, y as f64) * Self::CELL;
                let centre = corner.add_scalar(0.5 * Self::CELL);
                if wall.is_none_or(|w| line_distance(w, centre) <= 0.7072 * Self::CELL) {
                    visit(y * self.size.0 + x);
                }
            }
        }
    }
}

/// Amanatides and Woo's traversal of a grid along a ray (Eurographics 1987).
struct CellWalk {
    x: isize,
    y: isize,
    step: (isize, isize),
    next: (f64, f64),
    delta: (f64, f64),
}

impl CellWalk {
    /// Starts in the first cell of the grid on the ray; `None` if the ray misses the grid.
    fn enter(caster: &RayCaster, o: Vector2<f64>, d: Vector2<f64>) -> Option<Self> {
        let size = Vector2::new(caster.size.0 as f64, caster.size.1 as f64) * RayCaster::CELL;
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for axis in 0..2 {
            let rel = o[axis] - caster.origin[axis];
            if d[axis] == 0.0 {
                if rel < 0.0 || rel >= size[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = (-rel / d[axis], (size[axis] - rel) / d[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        if near >= far {
            return None;
        }
        let start = (o + d * near - caster.origin) / RayCaster::CELL;
        let x = (start.x as isize).clamp(0, caster.size.0 as isize - 1);
        let y = (start.y as isize).clamp(0, caster.size.1 as isize - 1);
        let axis = |cell: isize, o: f64, origin: f64, d: f64| {
            let edge = origin + (cell + isize::from(d > 0.0)) as f64 * RayCaster::CELL;
            let next = if d == 0.0 { f64::INFINITY } else { (edge - o) / d };
            (next, if d == 0.0 { f64::INFINITY } else { RayCaster::CELL / d.abs() })
        };
        let (nx, dx) = axis(x, o.x, caster.origin.x, d.x);
        let (ny, dy) = axis(y, o.y, caster.origin.y, d.y);
        let sign = |v: f64| if v > 0.0 { 1 } else { -1 };
        Some(CellWalk { x, y, step: (sign(d.x), sign(d.y)), next: (nx, ny), delta: (dx, dy) })
    }

    /// Distance along the ray at which it leaves the current cell.
    fn exit(&self) -> f64 {
        self.next.0.min(self.next.1)
    }

    /// Goes to the next cell; false outside the grid.
    fn step(&mut self, size: (usize, usize)) -> bool {
        if self.next.0 < self.next.1 {
            self.x += self.step.0;
            self.next.0 += self.delta.0;
        } else {
            self.y += self.step.1;
            self.next.1 += self.delta.1;
        }
        (0..size.0 as isize).contains(&self.x) && (0..size.1 as isize).contains(&self.y)
    }
}

fn nearer(a: Option<SurfaceHit>, b: Option<SurfaceHit>) -> Option<SurfaceHit> {
    match (a, b) {
        (Some(x), Some(y)) => Some(if y.range < x.range { y } else { x }),
        (x, None) => x,
        (None, y) => y,
    }
}

fn hit_wall(wall: &Wall, o: Vector2<f64>, d: Vector2<f64>) -> Option<SurfaceHit> {
    let along = wall.to - wall.from;
    let det = d.perp(&along);
    if det == 0.0 {
        return None;
    }
    let rel = wall.from - o;
    let (range, share) = (rel.perp(&along) / det, rel.perp(&d) / det);
    if range <= 0.0 || !(0.0..=1.0).contains(&share) {
        return None;
    }
    let normal = Vector2::new(-along.y, along.x).normalize();
    Some(SurfaceHit { range, normal: if normal.dot(&d) > 0.0 { -normal } else { normal } })
}

fn hit_circle(circle: &Circle, o: Vector2<f64>, d: Vector2<f64>) -> Option<SurfaceHit> {
    let rel = o - circle.centre;
    let half_b = rel.dot(&d);
    let root = half_b * half_b - rel.norm_squared() + circle.radius * circle.radius;
    if root < 0.0 {
        return None;
    }
    let range = -half_b - root.sqrt();
    (range > 0.0).then(|| SurfaceHit { range, normal: (rel + d * range) / circle.radius })
}

/// Distance of a point from the infinite line through a wall.
fn line_distance(wall: &Wall, point: Vector2<f64>) -> f64 {
    let along = wall.to - wall.from;
    let length = along.norm();
    if length == 0.0 { 0.0 } else { (point - wall.from).perp(&along).abs() / length }
}
