use super::places::{Place, PlaceIndex};
use super::{Link, MergingSettings};
use crate::SlamConfig;
use crate::loop_closing::{Candidate, ClosingSettings, SearchArea, Verifier};
use crate::map::Map;
use geometry::{GaussianPose2, Matrix3, Pose2, Vector3};
use manifold::{Islands, PatchId, Provenance};
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

/// Comparisons of places that are left to make, in passes: those that look most alike come first.
#[derive(Clone, Debug)]
pub(super) struct Recognition {
    /// What is compared in each pass, the last pass first: a place, and what is looked for there.
    passes: Vec<Vec<[PatchId; 2]>>,
    /// Comparisons made.
    pub tried: usize,
}

impl Recognition {
    /// Plans to compare every place with those of other islands that look most like it: one in each
    /// pass, for what a pass has joined the next one need not compare; in the second half of the
    /// passes more on a much larger island ([`PlaceIndex::crowding`]).
    pub fn new(map: &Map, index: &PlaceIndex, settings: &MergingSettings) -> Self {
        let alike = |query: &Place| {
            let crowding = index.crowding(query);
            let (plain, crowded) = (settings.candidates.div_ceil(2), settings.candidates / 2);
            let most = plain + crowded * crowding;
            let mut alike = index.alike(map, query, most, settings.apart_m).into_iter();
            let sizes = (0..settings.candidates).map(|k| if k < plain { 1 } else { crowding });
            let pass = |size| alike.by_ref().take(size).map(|p| [p.patch, query.patch]).collect();
            sizes.map(pass).collect::<Vec<Vec<[PatchId; 2]>>>()
        };
        let alike: Vec<Vec<Vec<[PatchId; 2]>>> = index.places.par_iter().map(alike).collect();
        let pass = |pass: usize| {
            let best = alike.iter().flat_map(|passes| &passes[pass]);
            let mut pairs: Vec<[PatchId; 2]> = best.copied().collect();
            pairs.sort_unstable();
            pairs
        };
        let passes = (0..settings.candidates).rev().map(pass).collect();
        Recognition { passes, tried: 0 }
    }

    /// True when no pass is left.
    pub fn is_done(&self) -> bool {
        self.passes.is_empty()
    }

    /// Makes the next pass, between islands that are still apart; `None` after the last.
    pub fn next_pass(
        &mut self,
        map: &Map,
        islands: &Islands,
        config: &SlamConfig,
    ) -> Option<Vec<PlaceMatch>> {
        let mut pairs = self.passes.pop()?;
        pairs.retain(|pair| islands.of(pair[0]) != islands.of(pair[1]));
        self.tried += pairs.len();
        let places: Vec<&[[PatchId; 2]]> = pairs.chunk_by(|a, b| a[0] == b[0]).collect();
        let verifier = Verifier::new(&config.for_merging());
        let found: Vec<Vec<PlaceMatch>> = places
            .par_iter()
            .map_init(|| verifier.clone(), |verifier, pairs| matches(verifier, pairs, map, config))
            .collect();
        Some(found.into_iter().flatten().collect())
    }
}

/// The queries that are found at a place, each looked for all round it.
fn matches(
    verifier: &mut Verifier,
    pairs: &[[PatchId; 2]],
    map: &Map,
    config: &SlamConfig,
) -> Vec<PlaceMatch> {
    let Some(&[place, _]) = pairs.first() else { return Vec::new() };
    let covariance = Matrix3::from_diagonal(&Vector3::from(ANYWHERE_STD).map(|std| std * std));
    let patch_from_query = GaussianPose2 { mean: Pose2::IDENTITY, covariance };
    let area = SearchArea::Around(config.merging.window_m);
    let candidate = Candidate { patch: place, patch_from_query, area };
    let mut host = verifier.host_for_any(place, map);
    let find = |&[_, query]: &[PatchId; 2]| {
        let closure = verifier.verify_at(&mut host, query, &candidate, map).ok()?;
        Some(PlaceMatch::new(place, query, &closure.result, config))
    };
    pairs.iter().filter_map(find).collect()
}

impl PlaceMatch {
    /// A verified match as a relation.
    pub fn new(from: PatchId, to: PatchId, found: &MatchResult, config: &SlamConfig) -> Self {
        let from_from_to = config.closure_relation(found);
        PlaceMatch { from, to, from_from_to, share: found.inlier_ratio }
    }

    /// The match seen from its other end.
    pub fn reversed(self) -> Self {
        let (from, to) = (self.to, self.from);
        PlaceMatch { from, to, from_from_to: self.from_from_to.inverse(), ..self }
    }

    /// The relation that the match would make.
    pub fn link(&self) -> Link {
        let PlaceMatch { from, to, from_from_to, .. } = *self;
        Link { from, to, from_from_to, provenance: Provenance::Merge }
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
