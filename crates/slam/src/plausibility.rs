use geometry::GaussianPose2;
use matching::MatchResult;

/// What a point that fits is worth, in nats of log-likelihood. Neighbouring points fit or fail
/// together, so it is less than a single measurement's worth.
const NATS_PER_POINT: f64 = 0.3;
/// Degrees of freedom of the Student distribution taken for odometry's error: now and then wheels
/// slip by far more than a Gaussian allows.
const STUDENT: f64 = 3.0;

/// Weighs how well a scan fits against how far the robot would have moved from what odometry says.
///
/// Indoors a wrong pose often fits nearly as well as the right one, and a pose inside the known map
/// always explains more of a scan than one beyond its edge; the fit alone must not decide.
pub(crate) struct Plausibility {
    predicted: GaussianPose2,
    points: f64,
    /// Odometry reads exactly no motion: wheels that stand and odometry that hangs look the same.
    silent: bool,
}

impl Plausibility {
    /// `predicted` is the pose expected with the motion's covariance; `silent` tells that odometry
    /// read exactly zero.
    pub fn new(predicted: GaussianPose2, points: usize, silent: bool) -> Self {
        Plausibility { predicted, points: points as f64, silent }
    }

    /// Log-likelihood of a match up to a constant; the higher the better.
    pub fn of(&self, result: &MatchResult) -> f64 {
        if !result.status.is_usable() {
            return f64::NEG_INFINITY;
        }
        let fit = NATS_PER_POINT * self.points * result.inlier_ratio;
        if self.silent {
            return fit;
        }
        // Student's t in three dimensions.
        fit - 0.5 * (STUDENT + 3.0) * (1.0 + self.distance2(result) / STUDENT).ln()
    }

    /// Squared Mahalanobis distance of a match from the prediction.
    pub fn distance2(&self, result: &MatchResult) -> f64 {
        self.predicted.mahalanobis_squared(&result.pose).unwrap_or(0.0)
    }

    /// The better of two matches; the first if they are equal.
    pub fn better(&self, first: MatchResult, second: MatchResult) -> MatchResult {
        if self.of(&second) > self.of(&first) { second } else { first }
    }
}
