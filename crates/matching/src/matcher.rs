use crate::PointCloud;
use geometry::{Matrix3, Pose2, Vector3};

/// How a match ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MatchStatus {
    /// The iteration settled and every direction is observed.
    Converged,
    /// The iteration settled, but one direction is hardly observed (a corridor, a circle).
    Degenerate {
        /// Unit vector `(x, y, yaw)` of the weakest direction, in the scan's frame.
        weak_axis: Vector3<f64>,
    },
    /// The fit is good, and another one elsewhere is as good: the pose is one of several.
    Ambiguous {
        /// The other one, `reference_from_scan`.
        rival: Pose2,
    },
    /// Fewer correspondences than a pose needs.
    TooFewPoints,
    /// The iteration left the search region or the fit is no better than chance.
    Diverged,
}

impl MatchStatus {
    /// True when the pose may be used, at least along the observed directions.
    pub fn is_usable(&self) -> bool {
        matches!(self, MatchStatus::Converged | MatchStatus::Degenerate { .. })
    }
}

/// What a scan matcher found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchResult {
    /// `reference_from_scan`: the scan's base frame in the reference frame.
    pub pose: Pose2,
    /// Covariance of `pose` as a right perturbation `(x, y, yaw)`, that is, in the scan's frame;
    /// from the measurement alone, without any prior.
    pub covariance: Matrix3<f64>,
    /// Share of the scan's points with an accepted correspondence, 0 to 1.
    pub inlier_ratio: f64,
    /// Iterations used.
    pub iterations: u32,
    /// How it ended.
    pub status: MatchStatus,
}

impl MatchResult {
    /// The answer of a match that found nothing: a pose that is as good as unknown.
    pub(crate) fn failed(pose: Pose2, iterations: u32, status: MatchStatus) -> Self {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e6, 1e6, 1e2));
        MatchResult { pose, covariance, inlier_ratio: 0.0, iterations, status }
    }
}

/// What is known of the pose before matching.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Initial guess, `reference_from_scan`.
    pub pose: Pose2,
    /// Information (inverse covariance) of the guess as a right perturbation in the scan's frame.
    /// Zero means a starting point only.
    pub information: Matrix3<f64>,
}

impl Prior {
    /// A starting point without any weight of its own.
    pub fn guess(pose: Pose2) -> Self {
        Prior { pose, information: Matrix3::zeros() }
    }
}

/// A scan matcher: scan to scan or scan to submap, by the size of the reference.
pub trait Matcher: Send + Sync {
    /// The name it goes by in the configuration and on the command line.
    fn name(&self) -> &'static str;

    /// Finds `reference_from_scan`, starting at the prior.
    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult;
}
