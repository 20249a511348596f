use super::MergingSettings;
use super::places::{Place, PlaceIndex};
use crate::SlamConfig;
use crate::loop_closing::{Candidate, ClosingSettings, SearchArea, Verifier};
use crate::map::Map;
use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use manifold::{Elevation, PatchId};
use matching::MatchResult;
use rayon::prelude::*;

/// Two patches of different islands whose surroundings fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaceMatch {
    /// The place.
    pub from: PatchId,
    /// The patch of another island that was found there.
    pub to: PatchId,
    /// `from_from_to` with the covariance of a relation.
    pub from_from_to: GaussianPose2,
    /// Share of the surroundings that fits.
    pub share: f64,
}

/// Nothing is known of where the query is: standard deviations, metres and radians.
const ANYWHERE_STD: [f64; 3] = [1e3, 1e3, 1e3];

/// Compares every place with those of other islands that look most like it. Also tells how many
/// comparisons that took.
pub(super) fn recognise(
    map: &Map,
    index: &PlaceIndex,
    config: &SlamConfig,
) -> (Vec<PlaceMatch>, usize) {
    let settings = &config.merging;
    let pairs: Vec<(PatchId, PatchId)> = index
        .places
        .par_iter()
        .flat_map_iter(|query: &Place| {
            let alike = index.alike(map, query, settings.candidates, settings.apart_m);
            alike.into_iter().map(|place| (query.patch, place.patch))
        })
        .collect();
    let verifier = Verifier::new(&config.for_merging());
    let found: Vec<Option<PlaceMatch>> = pairs
        .par_iter()
        .map_init(
            || verifier.clone(),
            |verifier, &(query, place)| {
                let found = find(verifier, query, place, map, settings)?;
                Some(PlaceMatch::new(place, query, &found, config))
            },
        )
        .collect();
    let matches = found.into_iter().flatten().collect();
    (matches, pairs.len())
}

/// The query seen from a place, looked for all round it.
fn find(
    verifier: &mut Verifier,
    query: PatchId,
    place: PatchId,
    map: &Map,
    settings: &MergingSettings,
) -> Option<MatchResult> {
    let covariance = Matrix3::from_diagonal(&Vector3::from(ANYWHERE_STD).map(|std| std * std));
    let patch_from_query = GaussianPose2 { mean: Pose2::IDENTITY, covariance };
    let area = SearchArea::Around(settings.window_m);
    let candidate = Candidate { patch: place, patch_from_query, area };
    verifier.verify(query, &candidate, map).map(|closure| closure.result).ok()
}

impl PlaceMatch {
    /// A verified match as a relation.
    pub fn new(from: PatchId, to: PatchId, found: &MatchResult, config: &SlamConfig) -> Self {
        let matched = found.covariance * config.closing.caution;
        let covariance = config.relation_covariance(&matched, None);
        let from_from_to = GaussianPose2 { mean: found.pose, covariance };
        PlaceMatch { from, to, from_from_to, share: found.inlier_ratio }
    }

    /// Height of the island of `to` above that of `from`, as the match has it: both ends stand on
    /// the same floor. `None` where nothing tells.
    pub fn rise(&self, map: &Map) -> Option<Elevation> {
        let [from, to] = [self.from, self.to].map(|end| map.manifold.patch(end).elevation);
        let (from, to) = from.zip(to)?;
        let variance_m2 = from.variance_m2 + to.variance_m2;
        Some(Elevation { height_m: from.height_m - to.height_m, variance_m2 })
    }

    /// False when two matches of the same islands say that they lie at different heights.
    pub fn agrees_in_height(&self, other: &PlaceMatch, map: &Map) -> bool {
        let rises = self.rise(map).zip(other.rise(map));
        rises.is_none_or(|(a, b)| !a.is_apart_from(&b))
    }

    /// The match seen from its other end.
    pub fn reversed(self) -> Self {
        let (from, to) = (self.to, self.from);
        PlaceMatch { from, to, from_from_to: self.from_from_to.inverse(), ..self }
    }

    /// The frame of the island of `to` seen from that of `from`, as the match has it.
    pub fn target_from_source(&self, map: &Map) -> Pose2 {
        map.pose(self.from) * self.from_from_to.mean * map.pose(self.to).inverse()
    }
}

impl SlamConfig {
    /// Loop closing between islands: nothing is known beforehand, so that larger surroundings must
    /// fit better than within one.
    pub(super) fn for_merging(&self) -> SlamConfig {
        let m = &self.merging;
        let closing = ClosingSettings {
            query_distance_m: m.query_distance_m,
            query_patches: m.query_patches,
            share: m.share,
            ..self.closing
        };
        SlamConfig { closing, ..*self }
    }
}
