use super::spans::{Span, Spans};
use crate::polyline::{Polyline, laser};
use geometry::{Matrix2, Pose2, Vector2, wrap_angle};

/// A view that hides more of the reference than this share is from the wrong place, and not
/// believed.
const HIDDEN_SHARE: f64 = 0.75;
/// A fitted normal may be so far off, as a cosine: less than this away from us is not facing away.
const FACING_AWAY: f64 = -0.1;

/// The reference's polyline as the scan would see it from a pose.
pub(super) struct View {
    spans: Spans,
    /// Reference points that the scan cannot see: behind others, or on surfaces that face away.
    pub hidden: Vec<bool>,
}

impl View {
    /// The view from a pose of a scan taken at `eye` in its own frame; points more than `hidden_m`
    /// behind others are hidden.
    pub fn new(polyline: &Polyline<'_>, pose: &Pose2, eye: Vector2<f64>, hidden_m: f64) -> Self {
        let points = &polyline.reference.points;
        let inverse = pose.inverse();
        let (sin, cos) = inverse.yaw.sin_cos();
        let (turn, shift) = (Matrix2::new(cos, -sin, sin, cos), inverse.translation() - eye);
        let polar: Vec<(f64, f64)> = points
            .iter()
            .map(|p| {
                let v = turn * p.position + shift;
                (v.norm(), v.y.atan2(v.x))
            })
            .collect();
        let mut faces = vec![false; points.len()];
        let mut ends = vec![false; points.len()];
        let mut spans = Vec::with_capacity(points.len());
        for (from, &(range, bearing)) in polar.iter().enumerate() {
            let Some(to) = polyline.next(from) else { continue };
            let (range_to, turn) = (polar[to].0, wrap_angle(polar[to].1 - bearing));
            let visible = turn * turn_at_laser(polyline, from, to) > 0.0;
            (ends[from], ends[to]) = (true, true);
            faces[from] |= visible;
            faces[to] |= visible;
            let (bearing, range) = ([bearing, bearing + turn], [range, range_to]);
            spans.push(Span { bearing, range, ends: [from, to], visible });
        }
        for (index, &(range, bearing)) in polar.iter().enumerate().filter(|(i, _)| !ends[*i]) {
            faces[index] = true;
            let (bearing, range) = ([bearing; 2], [range; 2]);
            spans.push(Span { bearing, range, ends: [index; 2], visible: true });
        }
        let mut spans = Spans::new(spans);
        let place = pose.transform(eye);
        let hidden = |(i, &(range, bearing)): (usize, &(f64, f64))| {
            let to_eye = place - points[i].position;
            let away = points[i].normal.is_some_and(|n| n.dot(&to_eye) < FACING_AWAY * range);
            !faces[i] || away || spans.covers(range - hidden_m, bearing)
        };
        let mut hidden: Vec<bool> = polar.iter().enumerate().map(hidden).collect();
        let count = hidden.iter().filter(|h| **h).count();
        if count as f64 > HIDDEN_SHARE * points.len() as f64 {
            hidden.fill(false);
            spans.iter_mut().for_each(|span| span.visible = true);
        }
        for span in spans.iter_mut() {
            span.visible &= span.ends.iter().all(|end| !hidden[*end]);
        }
        View { spans, hidden }
    }

    /// The matching-range rule: the point of the visible polyline at the range of a scan point,
    /// within a window of bearings; both as seen from the eye, in the scan's frame. The paper's
    /// window, and a gate on the difference in range that is left where none is the same.
    pub fn same_range(
        &self,
        seen: &Vector2<f64>,
        window_rad: f64,
        gate_m: f64,
    ) -> Option<Vector2<f64>> {
        let (range, bearing) = (seen.norm(), seen.y.atan2(seen.x));
        let place = self.spans.at_range(range, bearing, window_rad)?;
        let (sin, cos) = (bearing + place.offset_rad).sin_cos();
        (place.gap_m <= gate_m).then(|| Vector2::new(cos, sin) * place.range_m)
    }
}

/// The turn from one point to the next as the laser saw it that measured them; only its sign
/// counts.
fn turn_at_laser(polyline: &Polyline<'_>, from: usize, to: usize) -> f64 {
    let [from, to] = [from, to].map(|i| &polyline.reference.points[i]);
    let eye = laser(from);
    (from.position - eye).perp(&(to.position - eye))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polyline::PolylineSettings;
    use crate::{CloudPoint, PointCloud};

    /// A wall along `x = 4` and a board before it along `x = 2`, as seen from the origin.
    fn wall_and_board() -> PointCloud {
        let beam = |i: u32| {
            let bearing = (f64::from(i) - 100.0) * 0.005;
            let ray = Vector2::new(bearing.cos(), bearing.sin());
            let range = if (90..=110).contains(&i) { 2.0 } else { 4.0 } / bearing.cos();
            CloudPoint {
                position: ray * range,
                ray,
                range,
                normal: Some(Vector2::new(-1.0, 0.0)),
                normal_variance: 0.0,
                line_distance: 0.0,
                beam_step: 0.005,
                beam: i,
            }
        };
        PointCloud { points: (0..=200).map(beam).collect() }
    }

    fn hidden(pose: &Pose2) -> Vec<u32> {
        let cloud = wall_and_board();
        let settings = PolylineSettings { length_m: f64::INFINITY, segment_m: 0.5, reach_m: 1.0 };
        let polyline = Polyline::new(&cloud, Vector2::zeros(), settings);
        let view = View::new(&polyline, pose, Vector2::zeros(), 0.3);
        let points = cloud.points.iter().zip(&view.hidden);
        points.filter(|(_, hidden)| **hidden).map(|(p, _)| p.beam).collect()
    }

    #[test]
    fn a_board_hides_what_lies_behind_it_from_elsewhere() {
        assert_eq!(hidden(&Pose2::IDENTITY), Vec::<u32>::new());
        // From half a metre to the left the board hides the wall to the right of its old shadow.
        let beams = hidden(&Pose2::new(0.0, 0.5, 0.3));
        assert!(beams.len() > 10 && beams.iter().all(|beam| (60..90).contains(beam)), "{beams:?}");
    }

    #[test]
    fn a_board_is_not_seen_from_behind() {
        let beams = hidden(&Pose2::new(3.0, 0.0, 0.0));
        assert!((90..=110).all(|beam| beams.contains(&beam)), "{beams:?}");
        assert!(!beams.contains(&10) && !beams.contains(&190), "{beams:?}");
    }
}
