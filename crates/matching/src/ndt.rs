//! The Normal Distributions Transform, points to distributions and distributions to distributions.
//! Equations: docs/math/ndt.md.

mod cells;
mod climbing;
mod distribution;
mod distributions;
mod newton;
mod points;
mod table;

use crate::{CloudPoint, MatchResult, Matcher, PointCloud, Prior};
use cells::Cells;
use climbing::align;
use distributions::Distributions;
use geometry::{Matrix3, Pose2};
use newton::Cost;
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
    /// How often a cell is doubled for points that are too few for one.
    pub doublings: u32,
    /// A cell's smaller variance is at least this share of its larger one ...
    pub flatness: f64,
    /// ... and so many times that share at each coarser resolution: walls must be felt from afar.
    pub widening: f64,
    /// Factor on squared distances, `d2` of Stoyanov et al.: less lets farther points pull.
    pub softness: f64,
    /// Turned starts to either side, climbed where the first one leads nowhere ...
    pub turned_starts: u32,
    /// ... each so much farther, radians.
    pub start_step_rad: f64,
    /// A climb at the largest cells that explains less than this share may have led nowhere.
    pub good_fit: f64,
    /// Upper bound on Newton steps per resolution.
    pub max_iterations: u32,
    /// A step shorter than this, metres (and radians at 5 m), ends a resolution.
    pub step_m: f64,
    /// A smaller share of explained points is no better than chance.
    pub min_inlier_ratio: f64,
    /// A result farther from the start than this has left the search region, metres.
    pub max_shift_m: f64,
    /// The same for turns, radians.
    pub max_turn_rad: f64,
    /// See `ClosestSettings::degenerate_ratio`.
    pub degenerate_ratio: f64,
}

impl Default for NdtSettings {
    fn default() -> Self {
        NdtSettings {
            coarsest_m: 2.0,
            resolutions: 4,
            min_points: 3,
            doublings: 1,
            flatness: 1e-3,
            widening: 10.0,
            softness: 0.2,
            turned_starts: 2,
            start_step_rad: 0.3,
            good_fit: 0.6,
            max_iterations: 40,
            step_m: 1e-4,
            min_inlier_ratio: 0.15,
            max_shift_m: 3.0,
            max_turn_rad: 0.8,
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
    /// Standard deviation of a range, metres, for the covariance.
    pub range_std_m: f64,
}

impl Default for NdtD2dSettings {
    fn default() -> Self {
        NdtD2dSettings {
            ndt: NdtSettings { softness: 0.4, ..NdtSettings::default() },
            range_std_m: 0.015,
        }
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

/// What is climbed at one resolution.
trait Score {
    fn cost(&self, pose: &Pose2) -> Cost;
    fn doubt(&self, pose: &Pose2) -> Doubt;
    /// What of the scan is compared: the cost is at least `-4` for each.
    fn weight(&self) -> f64;
}

/// What remains unknown at the top.
struct Doubt {
    /// Covariance of the gradient by `(x, y, yaw)` in the reference frame.
    spread: Matrix3<f64>,
    /// The scan's points that the reference explains.
    explained: usize,
}

/// Beyond this squared distance a cell does not pull.
const FAR: f64 = 30.0;

/// With the largest cells about this many points are enough.
const COARSE_POINTS: usize = 120;

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
        let s = &self.settings;
        let (reference, scan) = (sane(reference), sane(&scan.in_order()));
        align(s, &scan, prior, |level| Points {
            cells: Cells::new(&reference, &level.shape(s, true)),
            scan: &scan,
            every: if level.coarsest { scan.len() / COARSE_POINTS } else { 1 },
            softness: s.softness,
        })
    }
}

impl Matcher for NdtD2dMatcher {
    fn name(&self) -> &'static str {
        "ndt-d2d"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let NdtD2dSettings { ndt, range_std_m } = self.settings;
        let (reference, scan) = (sane(reference), sane(scan));
        align(&ndt, &scan, prior, |level| Distributions {
            cells: Cells::new(&reference, &level.shape(&ndt, true)),
            reference: &reference,
            scan_cells: Cells::new(&scan, &level.shape(&ndt, false)),
            scan: &scan,
            softness: ndt.softness,
            range_std_m,
        })
    }
}
