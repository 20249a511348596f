use geometry::GaussianPose2;
use matching::MatchResult;

/// What a point that fits is worth, in nats of log-likelihood. Neighbouring points fit or fail
/// together, so it is less than a single measurement's worth.
const NATS_PER_POINT: f64 = 0.3;
/// Degrees of freedom of the Student distribution taken for odometry's error: now and then wheels
/// slip by far more than a Gaussian allows.
const STUDENT: f64 = 3.0;

/// How much less likely than the first the other poses expected are, in nats.
const ALTERNATIVE_NATS: f64 = 8.0;

/// Farther from the poses expected, both in metres and in standard deviations, a match is not
/// believed unless they are refuted: beyond the edge of the known map little of a scan is
/// explained, while in a corridor it fits at many places.
const FAR_M: f64 = 1.0;
const FAR_SIGMAS: f64 = 3.0;

/// Weighs how well a scan fits against how far the robot would have moved from what was expected.
///
/// Indoors a wrong pose often fits nearly as well as the right one, and a pose inside the known map
/// always explains more of a scan than one beyond its edge; the fit alone must not decide.
pub(crate) struct Plausibility<'a> {
    /// The poses that may be expected, with the motion's covariance, the most likely first; none:
    /// only the fit counts.
    expected: &'a [GaussianPose2],
    points: f64,
    /// The scan contradicts the map wherever it was expected.
    pub refuted: bool,
}

impl<'a> Plausibility<'a> {
    /// For a scan of `points` points that is expected at one of the poses `expected`.
    pub fn new(expected: &'a [GaussianPose2], points: usize) -> Self {
        Plausibility { expected, points: points as f64, refuted: false }
    }

    /// Log-likelihood of a match up to a constant; the higher the better. A match that is of no use
    /// leaves the robot where it was expected, with nothing explained.
    pub fn of(&self, result: &MatchResult) -> f64 {
        if !result.status.is_usable() {
            return 0.0;
        }
        if self.is_far(result) && !self.refuted {
            return f64::NEG_INFINITY;
        }
        let fit = NATS_PER_POINT * self.points * result.inlier_ratio;
        fit + self.nearest(result).map_or(0.0, |(_, likelihood)| likelihood)
    }

    /// True for a match far from all poses expected, by any measure.
    fn is_far(&self, result: &MatchResult) -> bool {
        let apart = |e: &GaussianPose2| e.mean.distance(&result.pose) > FAR_M;
        self.expected.iter().all(apart) && self.distance2(result) > FAR_SIGMAS * FAR_SIGMAS
    }

    /// The expected pose that explains a match best, by its index, and the log-likelihood of the
    /// motion given it.
    pub fn nearest(&self, result: &MatchResult) -> Option<(usize, f64)> {
        let likelihood = |(index, expected): (usize, &GaussianPose2)| {
            let penalty = if index == 0 { 0.0 } else { ALTERNATIVE_NATS };
            (index, log_student(expected, result) - penalty)
        };
        let likelihoods = self.expected.iter().enumerate().map(likelihood);
        // The first of equals.
        likelihoods.reduce(|best, next| if next.1 > best.1 { next } else { best })
    }

    /// Smallest squared Mahalanobis distance of a match from the poses expected.
    pub fn distance2(&self, result: &MatchResult) -> f64 {
        let distances = self.expected.iter().map(|e| distance2(e, result));
        distances.reduce(f64::min).unwrap_or(0.0)
    }

    /// The better of two matches; the first if they are equal.
    pub fn better(&self, first: MatchResult, second: MatchResult) -> MatchResult {
        if self.of(&second) > self.of(&first) { second } else { first }
    }
}

fn distance2(expected: &GaussianPose2, result: &MatchResult) -> f64 {
    expected.mahalanobis_squared(&result.pose).unwrap_or(0.0)
}

/// Student's t in three dimensions, up to a constant.
fn log_student(expected: &GaussianPose2, result: &MatchResult) -> f64 {
    -0.5 * (STUDENT + 3.0) * (1.0 + distance2(expected, result) / STUDENT).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Matrix3, Pose2};
    use matching::MatchStatus;

    fn expected(x: f64, std: f64) -> GaussianPose2 {
        let mean = Pose2::new(x, 0.0, 0.0);
        GaussianPose2 { mean, covariance: Matrix3::identity() * std * std }
    }

    fn fit(x: f64, inlier_ratio: f64) -> MatchResult {
        MatchResult {
            pose: Pose2::new(x, 0.0, 0.0),
            covariance: Matrix3::identity() * 1e-4,
            inlier_ratio,
            iterations: 3,
            status: MatchStatus::Converged,
        }
    }

    #[test]
    fn a_far_place_counts_only_when_the_expected_one_is_refuted() {
        let poses = [expected(4.0, 0.4)];
        let mut plausibility = Plausibility::new(&poses, 163);
        // Beyond the edge of the map little is explained, inside it nearly all.
        let (beyond, inside) = (fit(4.1, 0.32), fit(-0.8, 0.95));
        assert_eq!(plausibility.better(beyond, inside), beyond);
        plausibility.refuted = true;
        assert_eq!(plausibility.better(beyond, inside), inside);
    }

    #[test]
    fn a_few_points_that_fit_elsewhere_do_not_outweigh_a_match_of_no_use() {
        let poses = [expected(0.2, 0.03)];
        let mut plausibility = Plausibility::new(&poses, 8);
        plausibility.refuted = true;
        let failed = MatchResult { status: MatchStatus::TooFewPoints, ..fit(0.2, 0.0) };
        assert_eq!(plausibility.better(failed, fit(4.0, 0.76)), failed);
        assert_eq!(plausibility.better(failed, fit(0.21, 0.76)), fit(0.21, 0.76));
    }

    #[test]
    fn the_alternative_needs_a_clearly_better_fit() {
        let poses = [expected(0.0, 0.03), expected(0.5, 0.03)];
        let plausibility = Plausibility::new(&poses, 180);
        let stands = fit(0.0, 0.8);
        assert_eq!(plausibility.better(stands, fit(0.5, 0.85)), stands);
        assert_eq!(plausibility.better(stands, fit(0.5, 0.99)), fit(0.5, 0.99));
        assert_eq!(plausibility.nearest(&fit(0.5, 0.99)).map(|n| n.0), Some(1));
        assert_eq!(plausibility.nearest(&fit(0.1, 0.99)).map(|n| n.0), Some(0));
    }

    #[test]
    fn without_expectation_the_fit_decides() {
        let plausibility = Plausibility::new(&[], 100);
        assert_eq!(plausibility.better(fit(0.0, 0.6), fit(9.0, 0.7)), fit(9.0, 0.7));
        assert_eq!(plausibility.better(fit(0.0, 0.7), fit(9.0, 0.7)), fit(0.0, 0.7));
        assert_eq!(plausibility.nearest(&fit(0.0, 0.7)), None);
    }
}
