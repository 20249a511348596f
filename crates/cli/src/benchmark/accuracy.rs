use geometry::{LieGroup, Matrix3, Pose2, Vector3};
use matching::MatchResult;
use matching::protocol::{SUCCESS_M, median, pose_error};
use serde::Serialize;

/// Median of the chi-square distribution with three degrees of freedom.
const NEES_MEDIAN: f64 = 2.366;

/// One match with what it could have been at best.
pub struct Attempt {
    /// Error as a right perturbation `(x, y, yaw)` in the scan's frame.
    error: Vector3<f64>,
    covariance: Matrix3<f64>,
    bound: Option<Matrix3<f64>>,
    succeeded: bool,
    secs: f64,
}

impl Attempt {
    /// Compares a match with the truth.
    pub fn new(
        (found, secs): &(MatchResult, f64),
        truth: &Pose2,
        bound: Option<Matrix3<f64>>,
    ) -> Self {
        Attempt {
            error: truth.between(&found.pose).log(),
            covariance: found.covariance,
            bound,
            succeeded: found.status.is_usable() && pose_error(&found.pose, truth) < SUCCESS_M,
            secs: *secs,
        }
    }
}

/// How near to the Cramer-Rao bound, how honest, how often lost, how fast.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Matches tried.
    pub trials: usize,
    /// Not usable, or 0.1 m or more off by the protocol's distance; left out of the errors.
    pub failures: usize,
    /// Root mean square error of the translation, metres; none where all are lost.
    pub translation_rmse_m: Option<f64>,
    /// Root mean square error of the yaw, degrees.
    pub yaw_rmse_deg: Option<f64>,
    /// RMSE over the bound's, translation; 1 at best.
    pub translation_efficiency: Option<f64>,
    /// RMSE over the bound's, yaw.
    pub yaw_efficiency: Option<f64>,
    /// `sqrt(mean(e^T B^-1 e) / 3)` with B the bound: translation and yaw together.
    pub efficiency: Option<f64>,
    /// Median squared Mahalanobis error by the matcher's own covariance, over that expected: above
    /// 1 the matcher claims too much.
    pub nees: Option<f64>,
    /// Median time of a match, milliseconds.
    pub median_time_ms: f64,
}

impl Accuracy {
    /// Sums attempts up.
    pub fn of(attempts: &[Attempt]) -> Self {
        let good: Vec<&Attempt> = attempts.iter().filter(|a| a.succeeded).collect();
        let mean = |value: &dyn Fn(&Attempt) -> f64| {
            good.iter().map(|a| value(a)).sum::<f64>() / good.len().max(1) as f64
        };
        let xy = mean(&|a| a.error.xy().norm_squared());
        let yaw = mean(&|a| a.error.z * a.error.z);
        // A ratio needs a bound for each.
        let bounds: Option<Vec<Matrix3<f64>>> = good.iter().map(|a| a.bound).collect();
        let bounds = bounds.filter(|bounds| !bounds.is_empty());
        let over = |square: f64, part: &dyn Fn(&Matrix3<f64>) -> f64| {
            let bounds = bounds.as_ref()?;
            let mean = bounds.iter().map(part).sum::<f64>() / bounds.len() as f64;
            Some((square / mean).sqrt())
        };
        let together = bounds.as_ref().and_then(|bounds| {
            let squares: Option<Vec<f64>> =
                good.iter().zip(bounds).map(|(a, b)| mahalanobis(&a.error, b)).collect();
            Some((squares?.iter().sum::<f64>() / (3.0 * good.len() as f64)).sqrt())
        });
        let nees = median(good.iter().filter_map(|a| mahalanobis(&a.error, &a.covariance)));
        let some = |value: f64| (!good.is_empty()).then_some(value);
        Accuracy {
            trials: attempts.len(),
            failures: attempts.len() - good.len(),
            translation_rmse_m: some(xy.sqrt()),
            yaw_rmse_deg: some(yaw.sqrt().to_degrees()),
            translation_efficiency: over(xy, &|b| b[(0, 0)] + b[(1, 1)]),
            yaw_efficiency: over(yaw, &|b| b[(2, 2)]),
            efficiency: together,
            nees: nees.map(|nees| nees / NEES_MEDIAN),
            median_time_ms: 1e3 * median(attempts.iter().map(|a| a.secs)).unwrap_or_default(),
        }
    }
}

fn mahalanobis(error: &Vector3<f64>, covariance: &Matrix3<f64>) -> Option<f64> {
    Some(error.dot(&(covariance.try_inverse()? * error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_as_large_as_the_bound_are_one_times_the_bound() {
        let bound = Matrix3::from_diagonal(&Vector3::new(4e-6, 4e-6, 1e-6));
        let attempts: Vec<Attempt> = [(1.0, true), (-1.0, true), (900.0, false)]
            .into_iter()
            .map(|(sign, succeeded)| Attempt {
                error: Vector3::new(2e-3, 2e-3, 1e-3) * sign,
                covariance: bound * 4.0,
                bound: Some(bound),
                succeeded,
                secs: 0.002,
            })
            .collect();
        let found = Accuracy::of(&attempts);
        let near = |value: Option<f64>, expected: f64| {
            assert!((value.unwrap_or(f64::NAN) - expected).abs() < 1e-9, "{value:?} {expected}");
        };
        near(found.translation_efficiency, 1.0);
        near(found.yaw_efficiency, 1.0);
        near(found.efficiency, 1.0);
        near(found.nees, 3.0 / 4.0 / NEES_MEDIAN);
        assert_eq!((found.trials, found.failures, found.median_time_ms), (3, 1, 2.0));
    }

    #[test]
    fn nothing_succeeded_is_no_figure() {
        let found = Accuracy::of(&[]);
        assert_eq!(
            (found.efficiency, found.nees, found.translation_efficiency),
            (None, None, None)
        );
    }
}
