use crate::FloorPlan;
use geometry::{Pose2, Vector2};
use rand::{Rng, rngs::StdRng};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::f64::consts::PI;

/// Stops by their indices, in the order of driving.
pub(crate) type Route = Vec<usize>;

/// A floor plan with the ways a robot may drive: stops, and straight ways between them that are
/// free of everything by at least half a metre.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Site {
    /// What a laser sees.
    pub plan: FloorPlan,
    /// Where robots drive to, world frame, metres.
    pub stops: Vec<(f64, f64)>,
    /// Ways between stops, by their indices; driven both ways.
    pub ways: Vec<(usize, usize)>,
}

impl Site {
    /// Robots pass a stop within this of it, along x and y, so that no two drive the same line.
    const JITTER_M: f64 = 0.1;

    /// Adds a stop.
    pub(crate) fn stop(&mut self, at: (f64, f64)) -> usize {
        self.stops.push(at);
        self.stops.len() - 1
    }

    /// Adds ways along a sequence of stops.
    pub(crate) fn chain(&mut self, stops: &[usize]) {
        self.ways.extend(stops.windows(2).map(|pair| (pair[0], pair[1])));
    }

    /// Takes in another site; its stops are then numbered from the value returned.
    pub(crate) fn append(&mut self, other: Site) -> usize {
        let first = self.stops.len();
        self.plan.walls.extend(other.plan.walls);
        self.plan.circles.extend(other.plan.circles);
        self.stops.extend(other.stops);
        self.ways.extend(other.ways.into_iter().map(|(a, b)| (a + first, b + first)));
        first
    }

    /// The site moved.
    pub(crate) fn placed(&self, world_from_site: &Pose2) -> Site {
        self.mapped(|point| world_from_site.transform(point))
    }

    /// The site's mirror image: y turned round.
    pub(crate) fn mirrored(&self) -> Site {
        self.mapped(|point| Vector2::new(point.x, -point.y))
    }

    fn mapped(&self, map: impl Fn(Vector2<f64>) -> Vector2<f64>) -> Site {
        let mut site = self.clone();
        for wall in &mut site.plan.walls {
            (wall.from, wall.to) = (map(wall.from), map(wall.to));
        }
        for circle in &mut site.plan.circles {
            circle.centre = map(circle.centre);
        }
        for stop in &mut site.stops {
            let point = map(Vector2::new(stop.0, stop.1));
            *stop = (point.x, point.y);
        }
        site
    }

    /// Length of a route, metres.
    pub(crate) fn length(&self, route: &[usize]) -> f64 {
        route.windows(2).map(|pair| self.distance(pair[0], pair[1])).sum()
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (self.stops[a], self.stops[b]);
        f64::hypot(a.0 - b.0, a.1 - b.1)
    }

    fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut neighbours = vec![Vec::new(); self.stops.len()];
        for &(a, b) in &self.ways {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        neighbours
    }

    /// The shortest route (Dijkstra 1959), both ends included; empty where there is none.
    pub(crate) fn shortest(&self, from: usize, to: usize) -> Vec<usize> {
        let neighbours = self.neighbours();
        let mut before = vec![usize::MAX; self.stops.len()];
        let mut best = vec![f64::INFINITY; self.stops.len()];
        best[from] = 0.0;
        // Bits of numbers above zero are ordered as the numbers are.
        let mut open = BinaryHeap::from([Reverse((0.0_f64.to_bits(), from))]);
        while let Some(Reverse((bits, stop))) = open.pop() {
            let here = f64::from_bits(bits);
            for &next in &neighbours[stop] {
                let length = here + self.distance(stop, next);
                if length < best[next] {
                    (best[next], before[next]) = (length, stop);
                    open.push(Reverse((length.to_bits(), next)));
                }
            }
        }
        if best[to].is_infinite() {
            return Vec::new();
        }
        let mut route = vec![to];
        while route[route.len() - 1] != from {
            route.push(before[route[route.len() - 1]]);
        }
        route.reverse();
        route
    }

    /// Drives about from `start` for `metres`, among stops that are `allowed`, always along one of
    /// the ways driven least so far, and back only where there is no other.
    pub(crate) fn wander(
        &self,
        rng: &mut StdRng,
        start: usize,
        metres: f64,
        allowed: impl Fn(usize) -> bool,
    ) -> Vec<usize> {
        let neighbours = self.neighbours();
        let mut driven: BTreeMap<(usize, usize), u32> = BTreeMap::new();
        let (mut route, mut length) = (vec![start], 0.0);
        while length < metres {
            let here = route[route.len() - 1];
            let came_from = route.len().checked_sub(2).map(|i| route[i]);
            let key = |next: &usize| (here.min(*next), here.max(*next));
            let open = neighbours[here].iter().filter(|&&next| allowed(next));
            let (ahead, back): (Vec<&usize>, Vec<&usize>) =
                open.partition(|&&next| Some(next) != came_from);
            let choice = if ahead.is_empty() { back } else { ahead };
            let times = |next: &usize| driven.get(&key(next)).copied().unwrap_or(0);
            let Some(least) = choice.iter().map(|next| times(next)).min() else { break };
            let fresh: Vec<usize> =
                choice.into_iter().copied().filter(|next| times(next) == least).collect();
            let next = fresh[rng.random_range(0..fresh.len())];
            *driven.entry(key(&next)).or_default() += 1;
            length += self.distance(here, next);
            route.push(next);
        }
        route
    }

    /// A route as waypoints, each a little beside its stop; the robot first looks anywhere.
    pub(crate) fn waypoints(&self, rng: &mut StdRng, route: &[usize]) -> Vec<(f64, f64)> {
        let mut jitter = || rng.random_range(-Self::JITTER_M..Self::JITTER_M);
        let mut points: Vec<(f64, f64)> = route
            .iter()
            .map(|&stop| (self.stops[stop].0 + jitter(), self.stops[stop].1 + jitter()))
            .collect();
        if let Some(&(x, y)) = points.first() {
            let (sin, cos) = rng.random_range(-PI..PI).sin_cos();
            // A little beyond what counts as arrived: some centimetres are driven that way.
            points.insert(1, (x + 0.3 * cos, y + 0.3 * sin));
        }
        points
    }
}
