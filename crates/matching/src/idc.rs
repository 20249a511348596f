//! Iterative Dual Correspondence (Lu and Milios, "Robot pose estimation in unknown environments by
//! matching 2D range scans", CVPR 1994 and J. Intelligent and Robotic Systems 18, 1997; thesis
//! section 4.3.2, algorithm 4.4). Equations and departures: docs/math/closest-points.md.

mod motion;
mod spans;
mod view;

use crate::closest::{
    ClosestPair, ClosestPoints, ClosestSettings, PairWeight, RangeErrors, failed,
};
use crate::polyline::{Polyline, PolylineSettings, laser};
use crate::{CloudPoint, MatchResult, MatchStatus, Matcher, PointCloud, Prior};
use geometry::{LieGroup, Matrix2, Pose2, Vector2};
use motion::{PriorPull, closest_pairs, joined, motion, range_pairs};
use serde::{Deserialize, Serialize};
use view::View;

/// Settings of [`IdcMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IdcSettings {
    /// What all matchers of closest points share.
    pub closest: ClosestSettings,
    /// Neighbouring reference points nearer to each other than this are joined by a segment,
    /// metres.
    pub segment_m: f64,
    /// Half of the first window of bearings, `B_w0`, radians: the largest turn to be corrected.
    pub window_rad: f64,
    /// The window shrinks as `exp(-c t)` with the iteration `t`: `c`.
    pub window_decay: f64,
    /// Reference points farther than this behind others are occluded, metres.
    pub hidden_m: f64,
    /// Share of the pairs of equal range kept, those closest to each other.
    pub keep: f64,
}

impl Default for IdcSettings {
    fn default() -> Self {
        let closest = ClosestSettings { step_m: 1e-4, max_iterations: 200, ..Default::default() };
        IdcSettings {
            closest,
            segment_m: 0.5,
            window_rad: 0.7,
            window_decay: 0.15,
            hidden_m: 0.3,
            keep: 0.8,
        }
    }
}

/// IDC: every scan point is paired twice, with the closest point of the reference's polyline and,
/// within a window of bearings, with the point of the polyline at the same range. The first pairs
/// give the translation, the second the rotation; the window shrinks.
///
/// Before that, what the scan could not see from its present pose is taken out of the reference.
/// Once the window is narrower than a beam the second rule has nothing left to say, and the
/// closest points alone settle the pose.
#[derive(Clone, Copy, Debug, Default)]
pub struct IdcMatcher {
    /// The settings.
    pub settings: IdcSettings,
}

/// All pairs count alike: the inverse of a range's variance, so that a prior has its due.
struct Alike {
    information: f64,
}

impl PairWeight for Alike {
    fn of(&self, _: &ClosestPair, _: &Matrix2<f64>) -> Option<Matrix2<f64>> {
        Some(Matrix2::identity() * self.information)
    }
}

impl Matcher for IdcMatcher {
    fn name(&self) -> &'static str {
        "idc"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let s = &self.settings;
        let sane = |p: &&CloudPoint| p.position.norm() < 1e4 && laser(p).norm() < 1e4;
        let [reference, seen] = [reference, scan].map(|cloud| PointCloud {
            points: cloud.points.iter().filter(sane).copied().collect(),
        });
        let settings = PolylineSettings {
            length_m: f64::INFINITY,
            segment_m: s.segment_m,
            reach_m: s.closest.gate_start_m,
        };
        let mut polyline = Polyline::new(&reference, Vector2::zeros(), settings);
        let (pose, taken) = match self.turn(&mut polyline, &seen, prior) {
            Ok(turned) => turned,
            Err(failure) => return *failure,
        };
        let (settings, errors) = (&s.closest, RangeErrors { range_std_m: s.closest.range_std_m });
        let weight = &Alike { information: information(&s.closest) };
        let (correspondence, locked_turn_rad) = (&polyline, 0.0);
        let all = ClosestPoints { settings, correspondence, weight, scan, locked_turn_rad };
        // From the wide gate again: what turned the scan need not have moved it along a wall.
        let gate_m = s.closest.gate_start_m;
        let result =
            all.align_from(pose, gate_m, prior, |here, pose| errors.covariance(here, pose));
        MatchResult { iterations: result.iterations + taken, ..result }
    }
}

/// Inverse of a range's variance, 1/m^2.
fn information(settings: &ClosestSettings) -> f64 {
    settings.range_std_m.max(1e-4).powi(-2)
}

impl IdcMatcher {
    /// The dual iterations: the pose once the window is narrower than a beam, and how many.
    fn turn(
        &self,
        polyline: &mut Polyline<'_>,
        scan: &PointCloud,
        prior: &Prior,
    ) -> Result<(Pose2, u32), Box<MatchResult>> {
        let (s, c) = (&self.settings, &self.settings.closest);
        let eye = eye(scan);
        let beam_step = scan.points.iter().map(|p| p.beam_step).fold(0.0, f64::max);
        let narrowest = beam_step.clamp(1e-3, 0.1);
        let (mut pose, mut gate) = (prior.pose, c.gate_start_m);
        let (mut window, mut iterations) = (s.window_rad.min(std::f64::consts::PI), 0);
        while window > narrowest && iterations < c.max_iterations {
            iterations += 1;
            let mut view = View::new(polyline, &pose, eye, s.hidden_m);
            polyline.hide(std::mem::take(&mut view.hidden));
            let closest = closest_pairs(polyline, scan, &pose, eye, (gate, c.keep));
            let same_range = range_pairs(&view, scan, eye, (window, gate, s.keep));
            if closest.len() < c.min_pairs {
                return Err(failed(pose, iterations, MatchStatus::TooFewPoints));
            }
            let pull = PriorPull::new(prior, &pose, information(c));
            let translation = motion(&closest, eye, &pull);
            let rotation = if same_range.len() < c.min_pairs { &closest } else { &same_range };
            let rotation = motion(rotation, eye, &pull);
            let step = joined(&translation, &rotation, eye);
            pose = pose * step;
            if !pose.is_finite() || pose.distance(&prior.pose) > c.max_shift_m {
                return Err(failed(prior.pose, iterations, MatchStatus::Diverged));
            }
            if step.norm() < 0.05 * gate {
                gate = (gate * c.gate_decay).max(c.gate_end_m);
            }
            window *= (-s.window_decay.max(1e-3)).exp();
        }
        polyline.hide(View::new(polyline, &pose, eye, s.hidden_m).hidden);
        Ok((pose, iterations))
    }
}

/// Where the scan was taken from in its own frame: the mean of where its rays begin.
fn eye(scan: &PointCloud) -> Vector2<f64> {
    let sum: Vector2<f64> = scan.points.iter().map(laser).sum();
    sum / scan.len().max(1) as f64
}
