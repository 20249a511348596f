use geometry::{Pose2, Vector2};

/// A straight, infinitely thin wall from `from` to `to`, world frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end.
    pub from: Vector2<f64>,
    /// The other end.
    pub to: Vector2<f64>,
}

/// A round pillar or leg, world frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Its centre.
    pub centre: Vector2<f64>,
    /// Its radius.
    pub radius: f64,
}

/// Everything a horizontal laser can see of one floor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorPlan {
    /// Straight surfaces.
    pub walls: Vec<Wall>,
    /// Round surfaces.
    pub circles: Vec<Circle>,
}

impl FloorPlan {
    /// Half the thickness of the partition walls drawn by [`FloorPlan::partition`], metres.
    const HALF_THICKNESS: f64 = 0.06;

    /// A plan without any surface.
    pub fn new() -> Self {
        FloorPlan::default()
    }

    /// Adds one thin wall.
    pub fn wall(&mut self, from: (f64, f64), to: (f64, f64)) -> &mut Self {
        let (from, to) = (Vector2::new(from.0, from.1), Vector2::new(to.0, to.1));
        self.walls.push(Wall { from, to });
        self
    }

    /// Adds the walls along a sequence of corners.
    pub fn polyline(&mut self, corners: &[(f64, f64)]) -> &mut Self {
        for pair in corners.windows(2) {
            self.wall(pair[0], pair[1]);
        }
        self
    }

    /// Adds a closed axis-parallel rectangle between two opposite corners.
    pub fn rectangle(&mut self, min: (f64, f64), max: (f64, f64)) -> &mut Self {
        self.polyline(&[min, (max.0, min.1), max, (min.0, max.1), min])
    }

    /// Adds a wall of 12 cm with openings, each given as `(start, width)` in metres from `from`, in
    /// increasing order; the jambs of the openings are drawn, so that both faces and the reveals
    /// are seen.
    pub fn partition(
        &mut self,
        from: (f64, f64),
        to: (f64, f64),
        doors: &[(f64, f64)],
    ) -> &mut Self {
        let (a, b) = (Vector2::new(from.0, from.1), Vector2::new(to.0, to.1));
        let length = (b - a).norm();
        if length == 0.0 {
            return self;
        }
        let along = (b - a) / length;
        let mut start = 0.0;
        for &(door, width) in doors.iter().chain(&[(length, 0.0)]) {
            if door > start {
                let centre = a + along * (0.5 * (start + door));
                let size = (door - start, 2.0 * Self::HALF_THICKNESS);
                self.block((centre.x, centre.y), size, along.y.atan2(along.x));
            }
            start = door + width;
        }
        self
    }

    /// Adds a box (a cupboard, a crate) by centre, size along its own axes, and yaw.
    pub fn block(&mut self, centre: (f64, f64), size: (f64, f64), yaw: f64) -> &mut Self {
        let pose = Pose2::new(centre.0, centre.1, yaw);
        let (hx, hy) = (0.5 * size.0, 0.5 * size.1);
        let corners = [(-hx, -hy), (hx, -hy), (hx, hy), (-hx, hy), (-hx, -hy)].map(|(x, y)| {
            let p = pose.transform(Vector2::new(x, y));
            (p.x, p.y)
        });
        self.polyline(&corners)
    }

    /// Adds a round pillar.
    pub fn pillar(&mut self, centre: (f64, f64), radius: f64) -> &mut Self {
        self.circles.push(Circle { centre: Vector2::new(centre.0, centre.1), radius });
        self
    }

    /// Adds the four legs (radius 25 mm) of a table or chair by centre, size and yaw.
    pub fn legs(&mut self, centre: (f64, f64), size: (f64, f64), yaw: f64) -> &mut Self {
        let pose = Pose2::new(centre.0, centre.1, yaw);
        for (sx, sy) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
            let p = pose.transform(Vector2::new(sx * size.0, sy * size.1));
            self.pillar((p.x, p.y), 0.025);
        }
        self
    }

    /// Corners of the axis-parallel bounding box; both zero for an empty plan.
    pub fn bounds(&self) -> (Vector2<f64>, Vector2<f64>) {
        let ends = self.walls.iter().flat_map(|w| [w.from, w.to]);
        let discs = self.circles.iter().flat_map(|c| {
            let r = Vector2::repeat(c.radius);
            [c.centre - r, c.centre + r]
        });
        let mut points = ends.chain(discs);
        let Some(first) = points.next() else {
            return (Vector2::zeros(), Vector2::zeros());
        };
        points.fold((first, first), |(lo, hi), p| (lo.inf(&p), hi.sup(&p)))
    }

    /// Distance from a point to the nearest surface, metres; infinite for an empty plan.
    pub fn clearance(&self, point: Vector2<f64>) -> f64 {
        let walls = self.walls.iter().map(|w| {
            let along = w.to - w.from;
            let share = (point - w.from).dot(&along) / along.norm_squared().max(1e-300);
            (w.from + along * share.clamp(0.0, 1.0) - point).norm()
        });
        let circles = self.circles.iter().map(|c| ((c.centre - point).norm() - c.radius).max(0.0));
        walls.chain(circles).fold(f64::INFINITY, f64::min)
    }
}
