//! The Weighted Scan Matcher (Pfister, Kriechbaum, Roumeliotis, Burdick, "Weighted range sensor
//! matching algorithms for mobile robot displacement estimation", ICRA 2002), generalised from two
//! scans to clouds of any size and field of view. Equations and their derivations:
//! docs/math/wsm.md.

pub(crate) mod error_model;
mod information;
mod pairing;
mod step;

use crate::{MatchResult, MatchStatus, Matcher, PointCloud, Prior};
use error_model::{WeightedPoint, weighted_points};
use geometry::{Matrix2, Pose2};
use information::Information;
use pairing::{Pair, Pairing, WeightedPair};
use serde::{Deserialize, Serialize};
use step::alternating_step;

/// Which covariance the matcher reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WsmCovariance {
    /// What the estimator really does with errors: sensitivity and spread apart. Honest.
    #[default]
    Sandwich,
    /// The inverse of the pairs' summed information, as published: optimistic, since it counts the
    /// sampling of surfaces as knowledge of the position along them.
    Pairs,
}

/// Settings of the Weighted Scan Matcher.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WsmSettings {
    /// Standard deviation of a range, metres.
    pub range_std_m: f64,
    /// Standard deviation of a beam's bearing, radians.
    pub bearing_std_rad: f64,
    /// Magnitude of the range bias, metres.
    pub range_bias_m: f64,
    /// Factor on the standard deviation of the correspondence error. More than 1 takes weight off
    /// the direction along surfaces, where a pair knows little.
    pub corr_scale: f64,
    /// Count the correspondence error of the sparser point only, not of both.
    pub one_sided: bool,
    /// A nearest neighbour is at most half a sampling step away; false assumes a whole step.
    pub half_spacing: bool,
    /// Pairs farther apart than this are not made in the first iteration, metres.
    pub gate_start_m: f64,
    /// The same in the last iterations.
    pub gate_end_m: f64,
    /// Factor from one gate to the next, once the pose has settled at the first.
    pub gate_decay: f64,
    /// Cosine of the largest angle between the normals of a pair; -1 pairs anything.
    pub normal_cos: f64,
    /// Final gate on a pair's squared Mahalanobis distance; 9.2 keeps 99 % of good pairs.
    pub chi_squared_gate: f64,
    /// Upper bound on iterations.
    pub max_iterations: u32,
    /// A step shorter than this (metres; radians at the mean range) ends the iteration.
    pub step_m: f64,
    /// Fewer pairs than this are no match.
    pub min_pairs: usize,
    /// A smaller share of paired points is no better than chance.
    pub min_inlier_ratio: f64,
    /// A result farther from the start than this has left the search region, metres.
    pub max_shift_m: f64,
    /// Ratio of the weakest to the strongest direction's information below which a match is called
    /// degenerate.
    pub degenerate_ratio: f64,
    /// Which covariance to report.
    pub covariance: WsmCovariance,
}

impl Default for WsmSettings {
    fn default() -> Self {
        WsmSettings {
            range_std_m: 0.015,
            bearing_std_rad: 0.0005,
            range_bias_m: 0.0,
            corr_scale: 30.0,
            one_sided: false,
            half_spacing: true,
            gate_start_m: 1.0,
            gate_end_m: 0.1,
            gate_decay: 0.5,
            normal_cos: 0.8,
            chi_squared_gate: 9.2,
            max_iterations: 40,
            step_m: 5e-4,
            min_pairs: 8,
            min_inlier_ratio: 0.15,
            max_shift_m: 3.0,
            degenerate_ratio: 5e-3,
            covariance: WsmCovariance::Sandwich,
        }
    }
}

impl WsmSettings {
    /// The thesis's settings: 10 mm and 0.002 rad of noise, the whole sampling step of both scans,
    /// a fixed gate of 0.5 m, the published covariance.
    pub fn thesis() -> Self {
        WsmSettings {
            range_std_m: 0.01,
            bearing_std_rad: 0.002,
            corr_scale: 10.0,
            half_spacing: false,
            gate_start_m: 0.5,
            gate_end_m: 0.5,
            normal_cos: -1.0,
            chi_squared_gate: f64::INFINITY,
            max_iterations: 80,
            covariance: WsmCovariance::Pairs,
            ..WsmSettings::default()
        }
    }

    /// Settings by name: `default` or `thesis`.
    pub fn preset(name: &str) -> Option<Self> {
        match name {
            "default" => Some(WsmSettings::default()),
            "thesis" => Some(WsmSettings::thesis()),
            _ => None,
        }
    }
}

/// The gate is narrowed once steps are shorter than this share of it: narrowing while the pose
/// still moves loses the pairs that move it (docs/math/wsm.md, "The gate").
const SETTLED_SHARE: f64 = 0.02;

/// While the gate is wide, the pose is off by about this share of it, and pairs with it.
const POSE_ERROR_SHARE: f64 = 0.05;

/// While the gate is wide, about this many points of each cloud are enough.
const COARSE_POINTS: usize = 120;

/// The Weighted Scan Matcher.
#[derive(Clone, Copy, Debug, Default)]
pub struct WsmMatcher {
    /// The settings.
    pub settings: WsmSettings,
}

impl Matcher for WsmMatcher {
    fn name(&self) -> &'static str {
        "wsm"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        self.align_from(reference, scan, &prior.pose, prior)
    }
}

impl WsmMatcher {
    /// [`Matcher::align`] with a starting point that is not the prior's mean.
    pub fn align_from(
        &self,
        reference: &PointCloud,
        scan: &PointCloud,
        start: &Pose2,
        prior: &Prior,
    ) -> MatchResult {
        let reference = weighted_points(&reference.in_order(), &self.settings);
        let scan = weighted_points(&scan.in_order(), &self.settings);
        let arm = root_mean_square_range(&scan);
        let (thin_reference, thin_scan) = (thinned(&reference), thinned(&scan));
        let mut coarse = Pairing::new(&thin_reference, &thin_scan, self.settings.normal_cos);
        let mut fine = Pairing::new(&reference, &scan, self.settings.normal_cos);
        let mut pose = *start;
        let mut gate = self.settings.gate_start_m;
        let (mut iterations, mut settled, mut last_step) = (0, false, f64::INFINITY);
        while iterations < self.settings.max_iterations && !settled {
            iterations += 1;
            let wide = gate > self.settings.gate_end_m;
            let pairing = if wide { &mut coarse } else { &mut fine };
            let pairs = self.weighted_pairs(pairing, &pose, gate);
            let next = match alternating_step(&pairs, &pose, prior) {
                Some(next) if pairs.len() >= self.settings.min_pairs => next,
                _ => return MatchResult::failed(pose, iterations, MatchStatus::TooFewPoints),
            };
            let step = pose.between(&next);
            last_step = step.norm().max(arm * step.yaw.abs());
            pose = next;
            settled = last_step < self.settings.step_m && gate <= self.settings.gate_end_m;
            if last_step < SETTLED_SHARE * gate {
                gate = (gate * self.settings.gate_decay).max(self.settings.gate_end_m);
            }
        }
        let lost = pose.distance(start) > self.settings.max_shift_m;
        // Pairs may swap for ever between two equally good sets: small steps are settled enough.
        if lost || last_step > 0.1 * self.settings.gate_end_m {
            return MatchResult::failed(pose, iterations, MatchStatus::Diverged);
        }
        self.conclude(&mut fine, pose, iterations)
    }

    /// The pairs of one iteration. While the gate is wide, the chi-square gate has to wait: far
    /// pairs are what moves the scan; and the pose's own error is part of theirs.
    fn weighted_pairs(
        &self,
        pairing: &mut Pairing<'_>,
        pose: &Pose2,
        gate: f64,
    ) -> Vec<WeightedPair> {
        let wide = gate > self.settings.gate_end_m;
        let pose_variance = (POSE_ERROR_SHARE * (gate - self.settings.gate_end_m)).powi(2);
        let (s, c) = pose.yaw.sin_cos();
        let (r, p) = (Matrix2::new(c, -s, s, c), pose.translation());
        pairing
            .mutual_pairs(pose, gate)
            .iter()
            .filter_map(|pair| pair.weighted_at(&r, p, pose_variance, &self.settings))
            .filter(|pair| wide || pair.chi_squared() < self.settings.chi_squared_gate)
            .collect()
    }

    fn conclude(&self, pairing: &mut Pairing<'_>, pose: Pose2, iterations: u32) -> MatchResult {
        let s = &self.settings;
        let accepted = |pair: &Pair<'_>| {
            pair.weighted(&pose, 0.0, s).is_some_and(|w| w.chi_squared() < s.chi_squared_gate)
        };
        let mut pairs = pairing.mutual_pairs(&pose, s.gate_end_m);
        pairs.retain(accepted);
        let inlier_ratio = pairs.len() as f64 / pairing.scan_len().max(1) as f64;
        if pairs.len() < s.min_pairs {
            return MatchResult::failed(pose, iterations, MatchStatus::TooFewPoints);
        }
        let information = Information::of(&pairs, &pose, s);
        let (covariance, weak_axis) = information.covariance(s.degenerate_ratio);
        let status = match weak_axis {
            _ if inlier_ratio < s.min_inlier_ratio => MatchStatus::Diverged,
            Some(weak_axis) => MatchStatus::Degenerate { weak_axis },
            None => MatchStatus::Converged,
        };
        MatchResult { pose, covariance, inlier_ratio, iterations, status }
    }
}

/// Every n-th point, so that about [`COARSE_POINTS`] are left.
fn thinned(points: &[WeightedPoint]) -> Vec<WeightedPoint> {
    points.iter().step_by((points.len() / COARSE_POINTS).max(1)).copied().collect()
}

fn root_mean_square_range(points: &[WeightedPoint]) -> f64 {
    let sum: f64 = points.iter().map(|p| p.position.norm_squared()).sum();
    (sum / points.len().max(1) as f64).sqrt()
}
