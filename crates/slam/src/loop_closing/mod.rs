//! Loop closing by geometry: candidates from the uncertainty of the pose and from the look of the
//! place, searched by branch and bound, verified, and accepted only in sets that agree with one
//! another.

mod between_robots;
mod by_landmark;
mod by_user;
mod candidates;
mod consistency;
mod directions;
mod other_robots;
mod signature;
mod statistics;
mod verification;

use crate::SlamConfig;
use crate::map::Map;
use candidates::{Candidates, Looks};
use consistency::PendingClosures;
use geometry::{GaussianPose2, Pose2};
use manifold::{PatchId, Provenance};
use matching::MatchResult;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use statistics::{ClosingStatistics, Rejection};

pub(crate) use between_robots::BetweenRobots;
pub(crate) use by_landmark::LandmarkCloser;
pub(crate) use candidates::{Candidate, Query, SearchArea};
pub(crate) use signature::{Signature, signature_of};
pub(crate) use verification::Verifier;

/// Loop closing by geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClosingSettings {
    /// Look for closures.
    pub enabled: bool,
    /// Distance driven between two searches, metres.
    pub every_m: f64,
    /// Candidates are looked for within this many standard deviations.
    pub sigmas: f64,
    /// Patches whose origins lie this far apart may see the same place, metres.
    pub reach_m: f64,
    /// Candidates verified per search.
    pub candidates: usize,
    /// Candidates of one search lie at least this far apart, metres.
    pub spacing_m: f64,
    /// Half width of the search box, metres; beyond it candidates are chosen by the look of the
    /// place.
    pub window_m: f64,
    /// The query's own surroundings reach this far, metres ...
    pub query_distance_m: f64,
    /// ... over at most this many patches.
    pub query_patches: usize,
    /// A match farther than this from what was believed is implausible, standard deviations.
    pub sigmas_accepted: f64,
    /// Windows that one branch-and-bound search may examine.
    pub max_windows: usize,
    /// Likelihood a grid pose must reach in the branch-and-bound search.
    pub min_score: f32,
    /// Smallest share of the query's surroundings that must fit after refinement.
    pub share: f64,
    /// A rival pose that fits this share of the best one's fit makes the match ambiguous.
    pub rival: f64,
    /// Largest share of sight lines that may pass through walls of the candidate's submap.
    pub seen_through: f64,
    /// A closure's covariance is this many times that of a match where the robot has been all
    /// along: the right corridor may still be matched at the wrong door.
    pub caution: f64,
    /// A closure known less well than this along any axis says too little to be worth its risk,
    /// metres.
    pub largest_std_m: f64,
    /// Closures that must agree with a new one that moves the map.
    pub support: usize,
}

impl Default for ClosingSettings {
    fn default() -> Self {
        ClosingSettings {
            enabled: true,
            every_m: 1.0,
            sigmas: 3.0,
            reach_m: 3.0,
            candidates: 3,
            spacing_m: 3.0,
            window_m: 6.0,
            query_distance_m: 3.0,
            query_patches: 4,
            sigmas_accepted: 6.0,
            max_windows: 5_000,
            min_score: 0.55,
            share: 0.5,
            rival: 0.92,
            seen_through: 0.2,
            caution: 4.0,
            largest_std_m: 0.4,
            support: 2,
        }
    }
}

/// A verified closure: the query patch seen from the candidate patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closure {
    pub from: PatchId,
    pub to: PatchId,
    /// `from_from_to`.
    pub result: MatchResult,
    /// How far the closure would move the robot, seen from where it was believed to be.
    pub shift: Pose2,
    /// Squared Mahalanobis distance from what was believed.
    pub surprise: f64,
    /// Everywhere the query may be was searched, and it fits here alone.
    pub alone: bool,
}

/// Finds loops from new patches.
pub(crate) struct LoopCloser {
    settings: ClosingSettings,
    candidates: Candidates,
    looks: Looks,
    verifier: Verifier,
    pending: PendingClosures,
    last_query: Option<Pose2>,
    /// Patch from which places all round were last compared by their look.
    last_look: Option<Pose2>,
    pub statistics: ClosingStatistics,
}

impl LoopCloser {
    pub fn new(config: &SlamConfig) -> Self {
        LoopCloser {
            settings: config.closing,
            candidates: Candidates::new(config.closing, config.submap),
            looks: Looks::new(),
            verifier: Verifier::new(config),
            pending: PendingClosures::new(config.closing.support),
            last_query: None,
            last_look: None,
            statistics: ClosingStatistics::default(),
        }
    }

    /// The closures that a new patch completes: verified, and each in a consistent set.
    pub fn search(&mut self, query: PatchId, map: &Map) -> Vec<Closure> {
        let accepted = self.search_all(&[query], map);
        let expired = self.pending.expire(query, PATIENCE_PATCHES);
        self.statistics.unsupported += expired;
        accepted
    }

    /// [`LoopCloser::search`] from many patches of a map that stays as it is.
    pub fn search_all(&mut self, queries: &[PatchId], map: &Map) -> Vec<Closure> {
        let mut pairs = Vec::new();
        for &patch in queries {
            if let Some(query) = self.due(patch, map) {
                let candidates = self.candidates.of(query, &mut self.looks, map);
                pairs.extend(candidates.into_iter().map(|c| (patch, c)));
            }
        }
        self.verify_all(&pairs, map)
    }

    /// Those of some pairs of a query and a candidate that are closures to be accepted.
    fn verify_all(&mut self, pairs: &[(PatchId, Candidate)], map: &Map) -> Vec<Closure> {
        self.statistics.tried += pairs.len();
        // Each pair is looked at by itself and the answers are taken in order: the number of
        // threads makes no difference.
        let answers: Vec<Result<Closure, Rejection>> = pairs
            .par_iter()
            .map_init(
                || self.verifier.clone(),
                |verifier, (query, c)| verifier.verify(*query, c, map),
            )
            .collect();
        let mut accepted = Vec::new();
        for answer in answers {
            match answer {
                Ok(closure) => accepted.extend(self.admit(closure, map)),
                Err(rejection) => self.statistics.count(rejection),
            }
        }
        self.statistics.accepted += accepted.len();
        accepted
    }

    /// The closures that a verified one brings to acceptance.
    fn admit(&mut self, closure: Closure, map: &Map) -> Vec<Closure> {
        let set = self.pending.offer(closure, map);
        if set.len() > 1 && !closure.alone && self.has_rival(&closure, map) {
            self.statistics.rivalled += 1;
            return Vec::new();
        }
        self.pending.accept(&set);
        set
    }

    /// True when the query fits nearly as well somewhere else where the robot may be: along a
    /// corridor many closures agree with one another about the wrong door.
    fn has_rival(&self, closure: &Closure, map: &Map) -> bool {
        let places = self.candidates.everywhere(closure.to, map);
        let claimed = map.pose(closure.from) * closure.result.pose;
        let enough = self.settings.rival * closure.result.inlier_ratio;
        let rivals = |verifier: &mut Verifier, place: &Candidate| {
            let poses = verifier.possible(closure.to, place, enough, map);
            let place = map.pose(place.patch);
            poses.iter().any(|pose| (place * *pose).distance(&claimed) > RIVAL_M)
        };
        places
            .par_iter()
            .map_init(|| self.verifier.clone(), |verifier, place| rivals(verifier, place))
            .any(|rival| rival)
    }

    /// The search that is due at a patch, when the robot has driven far enough since the last one;
    /// notes it.
    fn due(&mut self, patch: PatchId, map: &Map) -> Option<Query> {
        let pose = map.pose(patch);
        let far = |last: Option<Pose2>, least_m: f64| {
            last.is_none_or(|last| last.distance(&pose) >= least_m)
        };
        if !self.settings.enabled || !far(self.last_query, self.settings.every_m) {
            return None;
        }
        let all_round = far(self.last_look, self.settings.spacing_m);
        self.last_query = Some(pose);
        if all_round {
            self.last_look = Some(pose);
        }
        Some(Query { patch, all_round })
    }

    /// Gives up on closures that are still waiting for support.
    pub fn finish(&mut self) {
        self.statistics.unsupported += self.pending.expire(PatchId(u32::MAX), 0);
    }
}

impl SlamConfig {
    /// What a match of places that were met again says, as a relation: known less well than it
    /// believes, see [`ClosingSettings::caution`].
    pub(crate) fn closure_relation(&self, found: &MatchResult) -> GaussianPose2 {
        let covariance = self.relation_covariance(&(found.covariance * self.closing.caution), None);
        GaussianPose2 { mean: found.pose, covariance }
    }
}

/// Adds closures to the map; true when one of them moves it noticeably.
pub(crate) fn relate(map: &mut Map, closures: &[Closure], config: &SlamConfig) -> bool {
    let mut moved = false;
    for closure in closures {
        let relation = config.closure_relation(&closure.result);
        map.manifold.relate(closure.from, closure.to, relation, Provenance::LoopClosure);
        moved |= closure.shift.norm() > NOTICEABLE_M || closure.shift.yaw.abs() > NOTICEABLE_RAD;
    }
    moved
}

/// A closure that moves the robot less than this does not call for a new optimisation at once.
const NOTICEABLE_M: f64 = 0.05;
const NOTICEABLE_RAD: f64 = 0.01;
/// A place farther than this from the one claimed is another one, metres.
const RIVAL_M: f64 = 1.0;
/// A closure waits for others to agree with it while this many patches are added.
const PATIENCE_PATCHES: u32 = 200;
