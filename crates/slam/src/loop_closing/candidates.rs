use super::ClosingSettings;
use super::other_robots::OtherRobots;
use super::signature::{Signature, signature_of};
use crate::map::Map;
use geometry::{GaussianPose2, Pose2};
use manifold::{INTERVAL_95, PatchId, SubmapLimits};
use std::collections::BTreeMap;

/// A place that may be the one the robot is at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Candidate {
    pub patch: PatchId,
    /// Present belief of the query, seen from the candidate patch.
    pub patch_from_query: GaussianPose2,
    /// Where to look for the query.
    pub area: SearchArea,
}

/// Where around a candidate to look for the query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SearchArea {
    /// Where the query is believed to be.
    Believed,
    /// Around the candidate itself, to this distance along either axis, metres: the belief is too
    /// vague to search.
    Around(f64),
}

/// A patch whose place is to be looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Query {
    pub patch: PatchId,
    /// Look all round, not only about where it is believed to be.
    pub all_round: bool,
}

/// Chooses the places to compare a new patch with.
pub(crate) struct Candidates {
    settings: ClosingSettings,
    limits: SubmapLimits,
    /// Look among other robots' patches instead of the robot's own.
    others: Option<OtherRobots>,
}

/// What places look like, as far as it was asked.
pub(crate) type Looks = BTreeMap<PatchId, Signature>;

/// Candidates are this many patches away from the query, so that they are places left and met
/// again, with surroundings that are complete; overlaps nearer by are the refit's business.
const SETTLED_PATCHES: u32 = 30;

impl Candidates {
    pub fn new(settings: ClosingSettings, limits: SubmapLimits) -> Self {
        Candidates { settings, limits, others: None }
    }

    /// Candidates on other robots' patches.
    pub fn of_others(settings: ClosingSettings, limits: SubmapLimits, map: &Map) -> Self {
        let others = Some(OtherRobots::new(map, settings, &limits));
        Candidates { others, ..Self::new(settings, limits) }
    }

    /// The best places for a query, best first, spaced apart: patches that are not known well
    /// enough to be in its local submap, but may see the same surfaces. Those within the search box
    /// around the belief are ranked by distance, those beyond it by the look of the place.
    pub fn of(&self, query: Query, looks: &mut Looks, map: &Map) -> Vec<Candidate> {
        let mut found: Vec<(f64, Candidate)> = Vec::new();
        let own = map.pose(query.patch);
        let mut query_look = None;
        for (patch, belief) in self.known(query, map) {
            let here = map.pose(patch).between(&own);
            let Some(by_look) = self.may_overlap(&here, &belief) else { continue };
            let rank = if by_look {
                let look_of = |patch| signature_of(patch, map, &self.limits);
                let look = query_look.get_or_insert_with(|| look_of(query.patch));
                100.0 + looks.entry(patch).or_insert_with(|| look_of(patch)).distance(look)
            } else {
                here.norm() + here.yaw.abs()
            };
            let patch_from_query = GaussianPose2 { mean: here, ..belief.inverse() };
            let area = if by_look {
                SearchArea::Around(self.settings.reach_m)
            } else {
                SearchArea::Believed
            };
            found.push((rank, Candidate { patch, patch_from_query, area }));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.patch.cmp(&b.1.patch)));
        self.spaced(found.into_iter().map(|f| f.1), map)
    }

    /// Places all over where the query may be, spaced so that searches around them leave little
    /// out.
    pub fn everywhere(&self, query: PatchId, map: &Map) -> Vec<Candidate> {
        let own = map.pose(query);
        let known = match &self.others {
            Some(others) => others.around(query, f64::INFINITY, |_| true, map),
            None => self.known(Query { patch: query, all_round: true }, map),
        };
        let mut chosen: Vec<Candidate> = Vec::new();
        for (patch, belief) in known {
            let here = map.pose(patch).between(&own);
            let near = |c: &Candidate| {
                map.pose(c.patch).distance(&map.pose(patch)) < self.settings.reach_m
            };
            if self.may_overlap(&here, &belief).is_none() || chosen.iter().any(near) {
                continue;
            }
            let patch_from_query = GaussianPose2 { mean: here, ..belief.inverse() };
            // The query may see what was mapped without being where it was mapped from.
            let area = SearchArea::Around(self.settings.window_m);
            chosen.push(Candidate { patch, patch_from_query, area });
        }
        chosen
    }

    /// Patches that are places left and perhaps met again, as they are known from the query: those
    /// in the search box, and all others when it looks all round.
    fn known(&self, query: Query, map: &Map) -> Vec<(PatchId, GaussianPose2)> {
        let own = map.pose(query.patch);
        let box_m = self.settings.reach_m + self.settings.window_m;
        if let Some(others) = &self.others {
            let radius_m = if query.all_round { f64::INFINITY } else { box_m };
            return others.met(query.patch, radius_m, map);
        }
        let patches = map.manifold.patches().iter();
        let possible: Vec<PatchId> = patches
            .filter(|p| p.id.0.abs_diff(query.patch.0) >= SETTLED_PATCHES)
            .filter(|p| query.all_round || p.island_from_patch.distance(&own) <= box_m)
            .filter(|p| map.comparable(p.id, query.patch))
            .map(|p| p.id)
            .collect();
        let known = map.manifold.uncertainty_from(query.patch, &possible);
        possible.into_iter().filter_map(|patch| Some((patch, known[patch.index()]?))).collect()
    }

    /// `None` when a patch is known to be elsewhere, or known well enough to be in the local
    /// submap; else whether it lies outside the search box around the belief, so that only its look
    /// can tell.
    fn may_overlap(&self, here: &Pose2, belief: &GaussianPose2) -> Option<bool> {
        let s = &self.settings;
        let sigma = belief.position_variance_m2().sqrt();
        let precise = INTERVAL_95 * sigma < self.limits.translation_m
            && INTERVAL_95 * belief.covariance[(2, 2)].sqrt() < self.limits.rotation_rad;
        let distance = here.norm() - s.reach_m;
        let apart = distance > s.sigmas * sigma;
        (!precise && !apart).then_some(distance > s.window_m)
    }

    fn spaced(&self, found: impl Iterator<Item = Candidate>, map: &Map) -> Vec<Candidate> {
        let mut chosen: Vec<Candidate> = Vec::new();
        let robot = |patch: PatchId| map.manifold.patch(patch).robot;
        let at_another_time = |a: PatchId, b: PatchId| match self.others {
            Some(_) => robot(a) != robot(b),
            None => a.0.abs_diff(b.0) > SETTLED_PATCHES,
        };
        for candidate in found {
            let here = map.pose(candidate.patch);
            let apart = |c: &Candidate| {
                map.pose(c.patch).distance(&here) > self.settings.spacing_m
                    || at_another_time(c.patch, candidate.patch)
            };
            // Looking all round is costly: once per search.
            let by_look = |c: &Candidate| c.area != SearchArea::Believed;
            let looked = by_look(&candidate) && chosen.iter().any(by_look);
            if !looked && chosen.iter().all(apart) {
                chosen.push(candidate);
            }
            if chosen.len() >= self.settings.candidates {
                break;
            }
        }
        chosen
    }
}
