//! The Normal Distributions Transform, points to distributions and distributions to distributions.
//! Equations: docs/math/ndt.md.

mod cells;
mod distributions;
mod newton;
mod points;

use crate::closest::{scale, weak_axis};
use crate::fast::turn;
use crate::{CloudPoint, MatchResult, MatchStatus, Matcher, PointCloud, Prior};
use cells::Cells;
use distributions::Distributions;
use geometry::{LieGroup, Matrix3, Pose2};
use newton::{Cost, Summit, climb};
use points::Points;
use serde::{Deserialize, Serialize};

/// Settings of [`NdtMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NdtSettings {
    /// Side of the largest cells, metres; each further resolution has half of it.
    pub coarsest_m: f64,
    /// Number of resolutions.
    pub resolutions: u32,
    /// Fewer points than this make no cell.
    pub min_points: usize,
    /// A cell's smaller variance is at least this share of its larger one ...
    pub flatness: f64,
    /// ... and so many times that share at each coarser resolution: walls must be felt from afar.
    pub widening: f64,
    /// Upper bound on Newton steps per resolution.
    pub max_iterations: u32,
    /// A step shorter than this, metres (and radians at 5 m), ends a resolution.
    pub step_m: f64,
    /// A smaller share of explained points is no better than chance.
    pub min_inlier_ratio: f64,
    /// A result farther from the start than this has left the search region, metres.
    pub max_shift_m: f64,
    /// See `ClosestSettings::degenerate_ratio`.
    pub degenerate_ratio: f64,
}

impl Default for NdtSettings {
    fn default() -> Self {
        NdtSettings {
            coarsest_m: 2.0,
            resolutions: 3,
            min_points: 3,
            flatness: 1e-3,
            widening: 10.0,
            max_iterations: 40,
            step_m: 1e-4,
            min_inlier_ratio: 0.15,
            max_shift_m: 3.0,
            degenerate_ratio: 5e-3,
        }
    }
}

/// The Normal Distributions Transform (Biber and Strasser, IROS 2003): the reference is a normal
/// distribution per cell, in four grids shifted by half a cell, and the scan's score is climbed by
/// Newton steps.
///
/// Undamped, as the thesis had it, Newton hardly ever moves far: the score is flat or curved the
/// wrong way except near its top. Here steps are damped until the score grows
/// (Levenberg-Marquardt), from large cells to small ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct NdtMatcher {
    /// The settings.
    pub settings: NdtSettings,
}

/// Settings of [`NdtD2dMatcher`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NdtD2dSettings {
    /// What it shares with points to distributions.
    pub ndt: NdtSettings,
    /// Factor on squared distances, `d2` of the paper: less lets farther cells pull.
    pub softness: f64,
    /// Standard deviation of a range, metres, for the covariance.
    pub range_std_m: f64,
}

impl Default for NdtD2dSettings {
    fn default() -> Self {
        NdtD2dSettings { ndt: NdtSettings::default(), softness: 1.0, range_std_m: 0.015 }
    }
}

/// NDT from distributions to distributions (Stoyanov, Magnusson, Andreasson, Lilienthal, "Fast and
/// accurate scan registration through minimization of the distance between compact 3D NDT
/// representations", IJRR 2012): the scan is cells as well, and cells are compared with cells.
#[derive(Clone, Copy, Debug, Default)]
pub struct NdtD2dMatcher {
    /// The settings.
    pub settings: NdtD2dSettings,
}

/// A point within three standard deviations of a cell is explained by it.
const EXPLAINED: f64 = 0.011;

/// What is climbed at one resolution.
trait Score {
    fn cost(&self, pose: &Pose2) -> Cost;
    fn doubt(&self, pose: &Pose2) -> Doubt;
}

/// What remains unknown at the top.
struct Doubt {
    /// Covariance of the gradient by `(x, y, yaw)` in the reference frame.
    spread: Matrix3<f64>,
    /// The scan's points that the reference explains.
    explained: usize,
}

/// Climbs from large cells to small ones; `score` is given the cells' side in metres and flatness.
fn align<S: Score>(
    s: &NdtSettings,
    scan: &PointCloud,
    prior: &Prior,
    score: impl Fn(f64, f64) -> S,
) -> MatchResult {
    let resolutions = s.resolutions.clamp(1, 10);
    let finest_m = s.coarsest_m * 0.5f64.powi(resolutions as i32 - 1);
    let (mut summit, mut iterations) =
        (Summit { pose: prior.pose, iterations: 0, settled: false }, 0);
    let mut last = None;
    for resolution in (0..resolutions).rev() {
        let flatness = s.flatness * s.widening.powi(resolution as i32);
        let score = score(finest_m * 2f64.powi(resolution as i32), flatness.min(1.0));
        let limits = (s.step_m, s.max_iterations);
        summit = climb(|pose| score.cost(pose), summit.pose, prior, limits);
        iterations += summit.iterations;
        last = Some(score);
    }
    let Summit { pose, settled, .. } = summit;
    let Some((here, doubt)) = last.map(|score| (score.cost(&pose), score.doubt(&pose))) else {
        return MatchResult::failed(prior.pose, iterations, MatchStatus::TooFewPoints);
    };
    if doubt.explained < 6 || scan.len() < 6 {
        return MatchResult::failed(prior.pose, iterations, MatchStatus::TooFewPoints);
    }
    if !settled || !pose.is_finite() || pose.distance(&prior.pose) > s.max_shift_m {
        return MatchResult::failed(prior.pose, iterations, MatchStatus::Diverged);
    }
    let inlier_ratio = doubt.explained as f64 / scan.len() as f64;
    conclude((&here.h, &doubt.spread), pose, iterations, inlier_ratio, s)
}

/// Points that are finite and not absurdly far.
fn sane(cloud: &PointCloud) -> PointCloud {
    let sane = |p: &&CloudPoint| p.position.norm() < 1e4 && p.ray.norm() < 1e4;
    PointCloud { points: cloud.points.iter().filter(sane).copied().collect() }
}

impl Matcher for NdtMatcher {
    fn name(&self) -> &'static str {
        "ndt"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let (reference, scan) = (sane(reference), sane(scan));
        align(&self.settings, &scan, prior, |side_m, flatness| Points {
            cells: Cells::new(&reference, side_m, flatness, self.settings.min_points),
            scan: &scan,
        })
    }
}

impl Matcher for NdtD2dMatcher {
    fn name(&self) -> &'static str {
        "ndt-d2d"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let NdtD2dSettings { ndt, softness, range_std_m } = self.settings;
        let (reference, scan) = (sane(reference), sane(scan));
        let cells = |cloud: &PointCloud, side_m, flatness| {
            Cells::new(cloud, side_m, flatness, ndt.min_points)
        };
        align(&ndt, &scan, prior, |side_m, flatness| Distributions {
            cells: cells(&reference, side_m, flatness),
            reference: &reference,
            scan_cells: cells(&scan, side_m, flatness),
            scan: &scan,
            softness,
            range_std_m,
        })
    }
}

/// Covariance `H^-1 spread H^-1`, in the scan's frame.
fn conclude(
    (h, spread): (&Matrix3<f64>, &Matrix3<f64>),
    pose: Pose2,
    iterations: u32,
    inlier_ratio: f64,
    s: &NdtSettings,
) -> MatchResult {
    let turn = turn(&pose);
    let (h, spread) = (turn.transpose() * h * turn, turn.transpose() * spread * turn);
    let scale = scale();
    let eigen = (scale * h * scale).symmetric_eigen();
    let most = eigen.eigenvalues.max();
    if most <= 0.0 {
        return MatchResult::failed(pose, iterations, MatchStatus::Diverged);
    }
    let inverse = eigen.eigenvalues.map(|v| 1.0 / v.max(1e-6 * most));
    let inverse = scale
        * (eigen.eigenvectors * Matrix3::from_diagonal(&inverse) * eigen.eigenvectors.transpose())
        * scale;
    let covariance = inverse * spread * inverse;
    let status = match weak_axis(&h, s.degenerate_ratio) {
        _ if inlier_ratio < s.min_inlier_ratio => MatchStatus::Diverged,
        Some(weak_axis) => MatchStatus::Degenerate { weak_axis },
        None => MatchStatus::Converged,
    };
    let covariance = 0.5 * (covariance + covariance.transpose());
    MatchResult { pose, covariance, inlier_ratio, iterations, status }
}
