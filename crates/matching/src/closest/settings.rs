use serde::{Deserialize, Serialize};

/// Settings of the matchers that iterate closest points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClosestSettings {
    /// Pairs farther apart than this are not made in the first iterations, metres ...
    pub gate_start_m: f64,
    /// ... and in the last.
    pub gate_end_m: f64,
    /// Factor from one gate to the next.
    pub gate_decay: f64,
    /// Share of the pairs kept, those with the smallest error.
    pub keep: f64,
    /// Of those, pairs are dropped whose error is more than so many times ...
    pub adaptive_factor: f64,
    /// ... that of this quantile; infinity for the factor drops none.
    pub adaptive_quantile: f64,
    /// Cosine of the largest angle between the normals of a pair; -1 pairs anything.
    pub normal_cos: f64,
    /// Standard deviation of a range, metres, for the covariance.
    pub range_std_m: f64,
    /// Upper bound on iterations.
    pub max_iterations: u32,
    /// A step shorter than this (metres; radians at 5 m) at the last gate ends the iteration.
    pub step_m: f64,
    /// Fewer pairs than this are no match.
    pub min_pairs: usize,
    /// A smaller share of paired points is no better than chance.
    pub min_inlier_ratio: f64,
    /// A result farther from the start than this has left the search region, metres.
    pub max_shift_m: f64,
    /// Ratio of the weakest to the strongest direction's information, yaw taken at 5 m, below which
    /// a match is called degenerate.
    pub degenerate_ratio: f64,
}

impl Default for ClosestSettings {
    fn default() -> Self {
        ClosestSettings {
            gate_start_m: 1.0,
            gate_end_m: 0.1,
            gate_decay: 0.7,
            keep: 0.9,
            adaptive_factor: f64::INFINITY,
            adaptive_quantile: 0.7,
            normal_cos: -1.0,
            range_std_m: 0.015,
            max_iterations: 60,
            step_m: 2e-4,
            min_pairs: 8,
            min_inlier_ratio: 0.15,
            max_shift_m: 3.0,
            degenerate_ratio: 5e-3,
        }
    }
}
