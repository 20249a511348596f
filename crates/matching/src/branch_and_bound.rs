use crate::{MatchResult, Matcher, PointCloud, Prior, SearchSettings, WideSettings};

/// Wide search by branch and bound, then refinement by the Weighted Scan Matcher.
///
/// Finds the best grid pose of the whole window, and the next best distinct ones; a good answer
/// does not depend on a good prior.
#[derive(Clone, Copy, Debug, Default)]
pub struct BranchAndBoundMatcher {
    /// The settings.
    pub settings: WideSettings,
}

impl Matcher for BranchAndBoundMatcher {
    fn name(&self) -> &'static str {
        "branch-and-bound"
    }

    fn align(&self, reference: &PointCloud, scan: &PointCloud, prior: &Prior) -> MatchResult {
        let search = SearchSettings {
            min_score: self.settings.min_score,
            candidates: self.settings.candidates,
            ..SearchSettings::default()
        };
        self.settings.align(reference, scan, prior, |pyramid, points, window| {
            pyramid.search_many(points, window, &search).candidates
        })
    }
}
