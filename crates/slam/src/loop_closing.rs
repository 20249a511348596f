use crate::active_submap::{ActiveSubmap, PatchPoints};
use geometry::{GaussianPose2, Pose2};
use manifold::{Manifold, PatchId, SubmapLimits};
use matching::{FastMatcher, FieldSettings, LinePoint, MatchResult, Prior};
use serde::{Deserialize, Serialize};

/// Loop closing by geometry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClosingSettings {
    /// Look for closures.
    pub enabled: bool,
    /// Distance driven between two searches, metres.
    pub every_m: f64,
    /// Candidates are searched within this many standard deviations.
    pub sigmas: f64,
    /// Patches whose origins may lie this far apart see the same place, metres.
    pub reach_m: f64,
    /// Candidates tried per search.
    pub candidates: usize,
    /// Smallest share of the scan that must fit.
    pub share: f64,
    /// Largest half width of the search, metres.
    pub window_m: f64,
    /// Floor
    pub floor_t: f64,
    /// Floor
    pub floor_r: f64,
}

impl Default for ClosingSettings {
    fn default() -> Self {
        ClosingSettings {
            enabled: true,
            every_m: 1.0,
            sigmas: 3.0,
            reach_m: 3.0,
            candidates: 2,
            share: 0.6,
            window_m: 8.0,
            floor_t: 0.005,
            floor_r: 0.001,
        }
    }
}

/// A place that may be the one the robot is at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub patch: PatchId,
    /// Present belief, candidate patch seen from the query patch.
    pub query_from_patch: GaussianPose2,
}

/// A closure found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closure {
    pub from: PatchId,
    pub to: PatchId,
    pub result: MatchResult,
    /// Squared Mahalanobis distance from the present belief.
    pub surprise: f64,
    pub shift: Pose2,
}

pub(crate) struct LoopCloser {
    settings: ClosingSettings,
    matcher: FastMatcher,
    submap: ActiveSubmap,
    limits: SubmapLimits,
    last_query: Option<Pose2>,
    pub tried: usize,
    pub pending: Vec<Closure>,
}

impl LoopCloser {
    pub fn new(settings: ClosingSettings, limits: SubmapLimits, field: FieldSettings, matcher: FastMatcher) -> Self {
        LoopCloser { settings, matcher, submap: ActiveSubmap::new(field), limits, last_query: None, tried: 0, pending: vec![] }
    }

    /// Closures found from a new patch.
    pub fn search(&mut self, query: PatchId, manifold: &Manifold, points: &PatchPoints) -> Vec<Closure> {
        let pose = manifold.patch(query).island_from_patch;
        if self.last_query.is_some_and(|last| last.distance(&pose) < self.settings.every_m) {
            return Vec::new();
        }
        self.last_query = Some(pose);
        let candidates = self.candidates(query, manifold);
        candidates.iter().filter_map(|c| self.verify(query, c, manifold, points)).collect()
    }

    fn candidates(&self, query: PatchId, manifold: &Manifold) -> Vec<Candidate> {
        let s = &self.settings;
        let known = manifold.uncertainty_from(query, s.window_m * s.window_m);
        let mut found: Vec<(f64, Candidate)> = manifold
            .patches()
            .iter()
            .filter_map(|p| {
                let belief = known[p.id.index()]?;
                if self.limits.admit(&belief) {
                    return None;
                }
                let sigma = (belief.covariance[(0, 0)] + belief.covariance[(1, 1)]).sqrt();
                let here = manifold.patch(query).island_from_patch.between(&p.island_from_patch);
                let excess = (here.norm() - s.reach_m).max(0.0);
                if excess > s.sigmas * sigma || sigma * 1.96 < self.limits.translation_m * 0.9 {
                    return None;
                }
                let belief = GaussianPose2 { mean: here, covariance: belief.covariance };
                Some((here.norm() + here.yaw.abs(), Candidate { patch: p.id, query_from_patch: belief }))
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut chosen: Vec<Candidate> = Vec::new();
        for (_, c) in found {
            let here = manifold.patch(c.patch).island_from_patch;
            let spaced = chosen.iter().all(|o| {
                manifold.patch(o.patch).island_from_patch.distance(&here) > 3.0
            });
            if spaced {
                chosen.push(c);
            }
            if chosen.len() >= s.candidates {
                break;
            }
        }
        chosen
    }

    fn verify(&mut self, query: PatchId, c: &Candidate, manifold: &Manifold, points: &PatchPoints) -> Option<Closure> {
        self.tried += 1;
        let s = self.settings;
        self.submap.rebuild(manifold, points, c.patch, &self.limits, 1.0);
        let scan = &points[query.index()];
        let guess = c.query_from_patch.mean.inverse();
        let belief = c.query_from_patch.inverse();
        let half = |i: usize, min: f64, max: f64| (s.sigmas * belief.covariance[(i, i)].sqrt()).clamp(min, max);
        let (wx, wy, wr) = (half(0, 0.3, s.window_m), half(1, 0.3, s.window_m), half(2, 0.1, 0.6));
        let best = self.multi_start(scan, &guess, (wx, wy, wr))?;
        if best.inlier_ratio < s.share {
            return None;
        }
        let delta = guess.between(&best.pose);
        let predicted = GaussianPose2 { mean: guess, covariance: belief.covariance + best.covariance };
        let surprise = predicted.mahalanobis_squared(&best.pose)?;
        Some(Closure { from: c.patch, to: query, result: best, surprise, shift: delta })
    }

    fn multi_start(&self, scan: &[LinePoint], guess: &Pose2, w: (f64, f64, f64)) -> Option<MatchResult> {
        let steps = |half: f64, step: f64| {
            let n = (half / step).ceil() as i32;
            (-n..=n).map(move |k| f64::from(k) * step)
        };
        let thin: Vec<LinePoint> = scan.iter().step_by(3).copied().collect();
        let mut best: Option<MatchResult> = None;
        for dr in steps(w.2, 0.17) {
            for dx in steps(w.0, 0.6) {
                for dy in steps(w.1, 0.6) {
                    let start = *guess * Pose2::new(dx, dy, dr);
                    let r = self.matcher.align(&self.submap.field, &thin, &Prior::guess(start));
                    if r.status.is_usable() && best.is_none_or(|b| r.inlier_ratio > b.inlier_ratio) {
                        best = Some(r);
                    }
                }
            }
        }
        let best = best?;
        Some(self.matcher.align(&self.submap.field, scan, &Prior::guess(best.pose)))
    }
}
