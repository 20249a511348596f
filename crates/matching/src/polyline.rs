use crate::closest::{Correspondence, Partner};
use crate::{CloudPoint, NeighbourTree, PointCloud};
use geometry::{Matrix2, Vector2};

/// Two points whose rays begin farther apart than this are not of one scan, metres: rounding only.
const SAME_LASER_M: f64 = 1e-6;
/// Long segments are found by more than one place on them, no farther apart than this, metres.
const PIECE_M: f64 = 0.1;
/// The tree compares in single precision: what that may be off by, metres.
const ROUNDING_M: f64 = 1e-3;

/// How a reference becomes a polyline, and how distances to it are measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PolylineSettings {
    /// What a radian counts for in the metric of motions, metres; infinity is Euclid's distance.
    pub length_m: f64,
    /// Neighbouring points nearer to each other than this are joined by a segment, metres.
    pub segment_m: f64,
    /// Points farther from a scan point than this are not looked at, metres.
    pub reach_m: f64,
}

/// The segments between the reference's neighbouring beams, and the single points.
///
/// Neighbours are told by their beams and by where their rays begin, not by their order: points may
/// come in any, and a reference of many scans is as many polylines.
pub(crate) struct Polyline<'a> {
    pub reference: &'a PointCloud,
    /// The end of the segment that begins at a point.
    next: Vec<Option<usize>>,
    tree: NeighbourTree,
    /// The point that each of the tree's places belongs to: that point, or the segment from it.
    owner: Vec<usize>,
    /// The segment that begins at each point.
    segments: Vec<Segment>,
    /// Points that are left out.
    hidden: Vec<bool>,
    /// The point that motions turn about.
    centre: Vector2<f64>,
    settings: PolylineSettings,
}

impl<'a> Polyline<'a> {
    /// The polyline of a reference, with motions about `centre`.
    pub fn new(
        reference: &'a PointCloud,
        centre: Vector2<f64>,
        settings: PolylineSettings,
    ) -> Self {
        let points = &reference.points;
        let next = neighbours(points, settings.segment_m);
        let (mut places, mut owner) = (Vec::new(), Vec::new());
        for (index, from) in points.iter().enumerate() {
            let to = next[index].map_or(from, |to| &points[to]);
            let along = to.position - from.position;
            let pieces = (along.norm() / PIECE_M).ceil().clamp(1.0, 1e3) as usize;
            // Nothing of a segment is farther from one of its places than half a piece.
            for piece in 0..pieces {
                places.push(from.position + along * ((piece as f64 + 0.5) / pieces as f64));
                owner.push(index);
            }
        }
        let tree = NeighbourTree::new(places);
        let hidden = vec![false; points.len()];
        let segments = Vec::new();
        let mut line =
            Polyline { reference, next, tree, owner, segments, hidden, centre, settings };
        line.segments = (0..points.len()).map(|index| line.segment(index)).collect();
        line
    }

    /// The end of the segment that begins at a point.
    pub fn next(&self, index: usize) -> Option<usize> {
        self.next[index]
    }

    /// Leaves points out, and segments that begin or end at one.
    pub fn hide(&mut self, hidden: Vec<bool>) {
        self.hidden = hidden;
    }

    /// Euclid's distance within which everything of a distance in the metric lies: at a point `r`
    /// from `moved` the metric shortens by `sqrt(1 + (m + r)^2 / L^2)` at most, `m` how far from
    /// the centre `moved` is, and a segment's begin farther by its length.
    fn stretched(&self, moved: &Vector2<f64>, distance_m: f64) -> f64 {
        let m = (moved - self.centre).norm() + self.settings.segment_m;
        let q2 = (distance_m / self.settings.length_m).powi(2);
        if q2 >= 1.0 {
            return self.settings.reach_m;
        }
        // r^2 = d^2 (1 + (m + r)^2 / L^2), solved for r.
        let constant = distance_m * distance_m + q2 * m * m;
        let r = (q2 * m + (q2 * q2 * m * m + (1.0 - q2) * constant).sqrt()) / (1.0 - q2);
        r.min(self.settings.reach_m)
    }

    /// The metric at a reference point.
    pub fn metric(&self, point: &Vector2<f64>) -> Matrix2<f64> {
        let p = point - self.centre;
        let u = Vector2::new(p.y, -p.x);
        Matrix2::identity()
            - u * u.transpose() / (p.norm_squared() + self.settings.length_m.powi(2))
    }

    /// The segment's point closest to `moved`, its squared distance, and the segment's direction if
    /// that point lies between its ends.
    fn closest_on(&self, index: usize, moved: &Vector2<f64>) -> OnSegment {
        let segment = &self.segments[index];
        let away = moved - segment.from;
        let ends = self.next[index].is_some_and(|to| !self.hidden[to]);
        let share = if ends { segment.share.dot(&away) } else { 0.0 };
        let inside = share > 0.0 && share < 1.0;
        let passed = segment.along * share.clamp(0.0, 1.0);
        let away = away - passed;
        let distance2 = away.norm_squared() - segment.turned.dot(&away).powi(2);
        let along = inside.then_some(segment.along);
        OnSegment { distance2, point: segment.from + passed, along }
    }

    /// What [`Polyline::closest_on`] needs of the segment from a point.
    fn segment(&self, index: usize) -> Segment {
        let from = self.reference.points[index].position;
        let to = self.next[index].map_or(from, |to| self.reference.points[to].position);
        let (along, m) = (to - from, self.metric(&from));
        let share = m * along / along.dot(&(m * along)).max(1e-12);
        let p = from - self.centre;
        let longest = p.norm_squared() + self.settings.length_m.powi(2);
        Segment { from, along, share, turned: Vector2::new(p.y, -p.x) / longest.sqrt() }
    }
}

/// A segment made ready to be compared with, or a point.
struct Segment {
    from: Vector2<f64>,
    along: Vector2<f64>,
    /// Its product with the way from `from` is the share of the segment passed, in the metric.
    share: Vector2<f64>,
    /// The metric is the identity less the outer product of this with itself.
    turned: Vector2<f64>,
}

struct OnSegment {
    distance2: f64,
    point: Vector2<f64>,
    along: Option<Vector2<f64>>,
}

impl Correspondence for Polyline<'_> {
    const SLIDES: bool = true;

    fn closest(&self, moved: &Vector2<f64>, gate_m: f64) -> Option<Partner> {
        let widest = self.stretched(moved, gate_m) + PIECE_M;
        // A place of the tree lies on the polyline: nothing farther than it is the closest.
        let (place, _) = self.tree.nearest(*moved, widest * widest)?;
        let owner = self.owner[place];
        let near = (!self.hidden[owner]).then(|| self.closest_on(owner, moved).distance2);
        let bound = near.map_or(gate_m, |near| gate_m.min(near.max(0.0).sqrt()));
        let radius = self.stretched(moved, bound) + 0.5 * PIECE_M + ROUNDING_M;
        let mut best: Option<(usize, OnSegment)> = None;
        self.tree.within(*moved, radius * radius, |place| {
            let index = self.owner[place];
            if self.hidden[index] {
                return;
            }
            let there = self.closest_on(index, moved);
            // Among equals the first point of the reference.
            let nearer =
                best.as_ref().is_none_or(|(i, b)| (there.distance2, index) < (b.distance2, *i));
            if there.distance2 <= gate_m * gate_m && nearer {
                best = Some((index, there));
            }
        });
        let (index, there) = best?;
        let point = CloudPoint { position: there.point, ..self.reference.points[index] };
        Some(Partner { index, point, along: there.along })
    }
}

/// For each point the one that the next beam of the same scan saw, if nearer than `segment_m`.
fn neighbours(points: &[CloudPoint], segment_m: f64) -> Vec<Option<usize>> {
    let mut by_beam: Vec<(u32, usize)> =
        points.iter().enumerate().map(|(i, p)| (p.beam, i)).collect();
    by_beam.sort_unstable();
    let next = |from: &CloudPoint| {
        let beam = from.beam.checked_add(1)?;
        let first = by_beam.partition_point(|entry| entry.0 < beam);
        let candidates = by_beam[first..].iter().take_while(|entry| entry.0 == beam);
        let near = candidates.filter_map(|&(_, to)| {
            let distance = (points[to].position - from.position).norm();
            let one_scan = (laser(&points[to]) - laser(from)).norm() < SAME_LASER_M
                && (points[to].ray - from.ray).norm() < 1.5 * from.beam_step;
            (one_scan && distance < segment_m).then_some((distance, to))
        });
        // Two scans may have been taken from one place: the nearer point continues the surface.
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, to)| to)
    };
    points.iter().map(next).collect()
}

/// Where a point's ray begins.
pub(crate) fn laser(point: &CloudPoint) -> Vector2<f64> {
    point.position - point.ray * point.range
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PointCloudSettings;
    use geometry::Pose2;
    use rand::{Rng, SeedableRng, rngs::StdRng};
    use synthetic::{LaserNoise, Scanner, noisy_room_pair};

    #[test]
    fn the_search_finds_what_all_segments_say() {
        let scanner = Scanner::half_circle(361, LaserNoise::gaussian(0.015));
        let pair = noisy_room_pair(5, &scanner, 0.3, 0.2);
        let settings = PointCloudSettings::default();
        let reference = PointCloud::from_scan(&pair.reference, &Pose2::IDENTITY, &settings);
        let rng = &mut StdRng::seed_from_u64(9);
        for length_m in [f64::INFINITY, 3.0] {
            let settings = PolylineSettings { length_m, segment_m: 0.5, reach_m: 1.5 };
            let line = Polyline::new(&reference, Vector2::new(0.3, -0.1), settings);
            for _ in 0..3000 {
                let near = reference.points[rng.random_range(0..reference.len())].position;
                let mut off = || rng.random_range(-0.4..0.4);
                let moved = near + Vector2::new(off(), off());
                let gate_m = rng.random_range(0.02..0.3);
                let all = (0..reference.len())
                    .map(|index| (line.closest_on(index, &moved), index))
                    .min_by(|a, b| a.0.distance2.total_cmp(&b.0.distance2).then(a.1.cmp(&b.1)))
                    .filter(|(there, _)| there.distance2 <= gate_m * gate_m);
                let found = line.closest(&moved, gate_m);
                let equal = match (&found, &all) {
                    // Where two segments meet, either will do.
                    (Some(found), Some((there, _))) => {
                        (found.point.position - there.point).norm() < 1e-9
                    }
                    (found, all) => found.is_none() && all.is_none(),
                };
                assert!(equal, "{moved} {gate_m} {length_m}: {:?}", found.map(|f| f.point));
            }
        }
    }
}
