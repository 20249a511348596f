use crate::closest::{
    ClosestPair, ClosestPoints, ClosestSettings, Correspondence, PairWeight, RangeErrors,
};
use crate::{CloudPoint, MatchResult, Matcher, NeighbourTree, PointCloud, Prior};
use geometry::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// Settings of [`MbIcpMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MbIcpSettings {
    /// What all matchers of closest points share; gates are distances of the metric.
    pub closest: ClosestSettings,
    /// What a radian counts for in the metric, metres: `L`. Infinity is Euclid's distance.
    pub length_m: f64,
    /// Neighbouring reference points nearer to each other than this are joined by a segment,
    /// metres.
    pub segment_m: f64,
    /// Reference points farther from a scan point than this are not looked at, metres.
    pub reach_m: f64,
}

impl Default for MbIcpSettings {
    fn default() -> Self {
        let closest = ClosestSettings { step_m: 1e-4, max_iterations: 200, ..Default::default() };
        MbIcpSettings { closest, length_m: 3.0, segment_m: 0.5, reach_m: 1.5 }
    }
}

/// Metric-based ICP (Minguez, Lamiraux, Montesano, "Metric-based scan matching algorithms for
/// mobile robot displacement estimation", ICRA 2005): the distance of two points is that of the
/// smallest motion, `x^2 + y^2 + L^2 theta^2`, that takes one to the other, so that far points may
/// be turned to their partners and not only shifted.
///
/// To first order that is `d^T M d` with `M = I - u u^T / (|p|^2 + L^2)`, `u = (p_y, -p_x)` for the
/// reference point `p` seen from where the scan is expected. (The thesis prints a plus; minimising
/// `|d - w J p|^2 + L^2 w^2` over `w` gives the minus.) The partner is the closest point on the
/// reference's polyline in this metric; the worst tenth of the pairs is dropped.
#[derive(Clone, Copy, Debug, Default)]
pub struct MbIcpMatcher {
    /// The settings.
    pub settings: MbIcpSettings,
}

/// The reference's polyline, and the point that motions turn about.
struct Polyline<'a> {
    reference: &'a PointCloud,
    tree: NeighbourTree,
    centre: Vector2<f64>,
    /// Length of the longest segment, metres.
    longest_m: f64,
    settings: &'a MbIcpSettings,
}

impl<'a> Polyline<'a> {
    fn new(reference: &'a PointCloud, centre: Vector2<f64>, settings: &'a MbIcpSettings) -> Self {
        let tree = NeighbourTree::new(reference.points.iter().map(|p| p.position));
        let mut polyline = Polyline { reference, tree, centre, longest_m: 0.0, settings };
        let length = |index: usize| {
            let to = polyline.segment_from(index)?;
            Some((to.position - reference.points[index].position).norm())
        };
        let lengths = (0..reference.len()).filter_map(length);
        polyline.longest_m = lengths.fold(0.0, f64::max);
        polyline
    }

    /// Points farther away than this are not within the gate: the metric shortens a distance by
    /// `sqrt(1 + |p|^2 / L^2)` at most. A segment may begin farther off by its length.
    fn radius_m(&self, moved: &Vector2<f64>, gate_m: f64) -> f64 {
        let settings = self.settings;
        let far = (moved - self.centre).norm() + settings.reach_m;
        let stretch = (1.0 + (far / settings.length_m).powi(2)).sqrt();
        (gate_m * stretch).min(settings.reach_m) + self.longest_m
    }

    /// `M` at a reference point.
    fn metric(&self, point: &Vector2<f64>) -> Matrix2<f64> {
        let p = point - self.centre;
        let u = Vector2::new(p.y, -p.x);
        Matrix2::identity()
            - u * u.transpose() / (p.norm_squared() + self.settings.length_m.powi(2))
    }

    /// The end of the segment that begins at a reference point, if one does.
    fn segment_from(&self, index: usize) -> Option<&CloudPoint> {
        let (from, to) = (self.reference.points.get(index)?, self.reference.points.get(index + 1)?);
        let neighbours = to.beam == from.beam.wrapping_add(1);
        let near = (to.position - from.position).norm() < self.settings.segment_m;
        (neighbours && near).then_some(to)
    }

    /// The point of segment `index` closest to `moved`, and its squared distance.
    fn closest_on(&self, index: usize, moved: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let from = self.reference.points[index].position;
        let m = self.metric(&from);
        let share = self.segment_from(index).map_or(0.0, |to| {
            let along = to.position - from;
            let length2 = along.dot(&(m * along));
            (along.dot(&(m * (moved - from))) / length2.max(1e-12)).clamp(0.0, 1.0)
        });
        let end = self.segment_from(index).map_or(from, |to| to.position);
        let point = from + (end - from) * share;
        let d = moved - point;
        (d.dot(&(m * d)), point)
    }
}

impl Correspondence for Polyline<'_> {
    fn closest(&self, moved: &Vector2<f64>, gate_m: f64) -> Option<(usize, CloudPoint)> {
        let mut best: Option<(f64, usize, Vector2<f64>)> = None;
        let radius_m = self.radius_m(moved, gate_m);
        self.tree.within(*moved, radius_m * radius_m, |index| {
            let (distance2, point) = self.closest_on(index, moved);
            // Among equals the first point of the reference.
            let nearer = best.is_none_or(|b| (distance2, index) < (b.0, b.1));
            if distance2 <= gate_m * gate_m && nearer {
                best = Some((distance2, index, point));
            }
        });
        let (_, index, position) = best?;
        Some((index, CloudPoint { position, ..self.reference.points[index] }))
    }
}

impl PairWeight for Polyline<'_> {
    fn of(&self, pair: &ClosestPair, _: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        Some(self.metric(&pair.reference.position))
    }
}

impl Matcher for MbIcpMatcher {
    fn name(&self) -> &'static str {
        "mbicp"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let polyline = Polyline::new(reference, prior.pose.translation(), &self.settings);
        let settings = &self.settings.closest;
        let errors = RangeErrors { range_std_m: settings.range_std_m };
        ClosestPoints { settings, correspondence: &polyline, weight: &polyline, scan }
            .align(prior, |here, pose| errors.covariance(here, pose))
    }
}
