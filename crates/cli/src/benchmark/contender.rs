use geometry::Pose2;
use matching::{MatchResult, Matcher, MatcherKind, PointCloud, PointCloudSettings, Prior};
use sensing::Scan;
use std::time::Instant;

/// A matcher that takes part.
pub struct Contender {
    /// Its name.
    pub name: &'static str,
    matcher: Box<dyn Matcher>,
}

/// Two clouds to match, with the truth.
pub struct Pair {
    /// The reference cloud.
    pub reference: PointCloud,
    /// The scan's cloud.
    pub scan: PointCloud,
    /// `reference_from_scan`, true or taken for true.
    pub truth: Pose2,
}

impl Contender {
    /// The named matchers with their default settings, each once; all without a name.
    pub fn named(names: &[String]) -> Vec<Contender> {
        let mut kinds: Vec<MatcherKind> = Vec::new();
        for kind in names.iter().filter_map(|name| MatcherKind::named(name)) {
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        if kinds.is_empty() {
            kinds = MatcherKind::ALL.to_vec();
        }
        kinds
            .into_iter()
            .map(|kind| Contender { name: kind.name(), matcher: kind.build() })
            .collect()
    }

    /// One match from a guess, and the seconds it took.
    pub fn timed(&self, pair: &Pair, guess: &Pose2) -> (MatchResult, f64) {
        let began = Instant::now();
        let found = self.matcher.align(&pair.reference, &pair.scan, &Prior::guess(*guess));
        (found, began.elapsed().as_secs_f64())
    }
}

/// A scan's cloud as every matcher gets it.
pub fn cloud(scan: &Scan, base_from_laser: &Pose2) -> PointCloud {
    PointCloud::from_scan(scan, base_from_laser, &PointCloudSettings::default())
}
