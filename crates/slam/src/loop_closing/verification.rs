use super::candidates::{Candidate, SearchArea};
use super::directions::{Directions, Turns};
use super::{ClosingSettings, Closure, Rejection};
use crate::SlamConfig;
use crate::active_submap::ActiveSubmap;
use crate::map::Map;
use geometry::{GaussianPose2, Pose2, Vector2};
use manifold::{PatchId, SubmapLimits};
use matching::{
    FastMatcher, LikelihoodPyramid, LinePoint, MatchResult, Prior, SearchSettings, SearchWindow,
};
use std::f64::consts::PI;

/// Compares the surroundings of a query with a candidate's local submap.
#[derive(Clone, Debug)]
pub(crate) struct Verifier {
    settings: ClosingSettings,
    limits: SubmapLimits,
    matcher: FastMatcher,
    submap: ActiveSubmap,
    /// See `SlamConfig::match_correlation`.
    correlation: f64,
}

/// A place made ready for queries to be looked for in its submap.
pub(crate) struct Host {
    pyramid: LikelihoodPyramid,
    /// Where its surfaces face, if searches all round are to be limited by that.
    directions: Option<Directions>,
    /// The submap's field is laid: it is needed only once something is found.
    is_laid: bool,
}

/// Candidates taken from branch and bound to refinement, to see whether one stands out.
const RIVALS: usize = 3;
/// One in so many points of a place tells where its surfaces face.
const DIRECTIONS_STEP: usize = 4;
/// Points of the query's surroundings are thinned to one in a square of this side, metres.
const THINNING_M: f32 = 0.3;

impl Verifier {
    pub fn new(config: &SlamConfig) -> Self {
        Verifier {
            settings: config.closing,
            limits: config.submap,
            matcher: FastMatcher { settings: config.matcher },
            submap: ActiveSubmap::new(config.field),
            correlation: config.match_correlation,
        }
    }

    /// Finds the query in the candidate's submap, or says why not.
    pub fn verify(
        &mut self,
        query: PatchId,
        candidate: &Candidate,
        map: &Map,
    ) -> Result<Closure, Rejection> {
        let mut host = self.host(candidate.patch, map);
        self.verify_at(&mut host, query, candidate, map)
    }

    /// Makes a place ready for [`Verifier::verify_at`].
    pub fn host(&mut self, place: PatchId, map: &Map) -> Host {
        self.submap.gather(map, place, &self.limits);
        Host { pyramid: self.submap.pyramid(map), directions: None, is_laid: false }
    }

    /// [`Verifier::host`] for queries of which nothing is known: only turns are searched that bring
    /// the directions of walls together.
    pub fn host_for_any(&mut self, place: PatchId, map: &Map) -> Host {
        let host = self.host(place, map);
        let surfaces = self.submap.members.iter().flat_map(|(patch, pose)| {
            map.surface(*patch).iter().step_by(DIRECTIONS_STEP).map(LinePoint::mover(pose))
        });
        Host { directions: Some(Directions::of(surfaces)), ..host }
    }

    /// [`Verifier::verify`] in the submap of the place that was made ready last, which is the
    /// candidate's.
    pub fn verify_at(
        &mut self,
        host: &mut Host,
        query: PatchId,
        candidate: &Candidate,
        map: &Map,
    ) -> Result<Closure, Rejection> {
        let fits = self.fits(host, query, candidate, map);
        let best = *fits.first().ok_or(Rejection::NotFound)?;
        let own_share = self.matcher.conclude(&self.submap.field, map.surface(query), best.pose, 0);
        if !best.status.is_usable()
            || best.inlier_ratio < self.settings.share
            || own_share.inlier_ratio < self.settings.share
        {
            return Err(Rejection::PoorFit);
        }
        let distinct = |m: &MatchResult| {
            let d = best.pose.between(&m.pose);
            d.norm() > 0.4 || d.yaw.abs() > 0.2
        };
        let rival = self.settings.rival * best.inlier_ratio;
        if fits[1..].iter().any(|m| m.inlier_ratio > rival && distinct(m)) {
            return Err(Rejection::Ambiguous);
        }
        if self.looks_through_walls(query, &best.pose, candidate, map) {
            return Err(Rejection::SeenThrough);
        }
        let spread =
            |i: usize| (best.covariance[(i, i)] * self.settings.caution * self.correlation).sqrt();
        if spread(0).max(spread(1)) > self.settings.largest_std_m {
            return Err(Rejection::Degenerate);
        }
        let closure = self.closure(query, candidate, best);
        if closure.surprise > self.settings.sigmas_accepted.powi(2) {
            return Err(Rejection::Implausible);
        }
        Ok(closure)
    }

    /// Largest share of sight lines that pass through the other's walls, beyond what its own do,
    /// when a query is at a pose seen from a place: of the query's through the place's submap, and
    /// of the place's through the query's. The pose is refined first.
    pub fn contradiction(
        &mut self,
        query: PatchId,
        place: PatchId,
        place_from_query: &Pose2,
        map: &Map,
    ) -> f64 {
        self.submap.rebuild(map, place, &self.limits, 1.0);
        self.contradiction_at(query, place, place_from_query, map)
    }

    /// [`Verifier::contradiction`] in the submap of the place that was made ready last.
    pub fn contradiction_in(
        &mut self,
        mut host: Host,
        query: PatchId,
        place: PatchId,
        place_from_query: &Pose2,
        map: &Map,
    ) -> f64 {
        self.lay(&mut host, map);
        self.contradiction_at(query, place, place_from_query, map)
    }

    fn contradiction_at(
        &mut self,
        query: PatchId,
        place: PatchId,
        place_from_query: &Pose2,
        map: &Map,
    ) -> f64 {
        let surroundings = self.surroundings(query, map);
        let refined = self.refine(&surroundings, place_from_query);
        let pose = if refined.status.is_usable() && is_near(&refined.pose, place_from_query) {
            refined.pose
        } else {
            *place_from_query
        };
        let beyond = |verifier: &Self, guest: PatchId, host: PatchId, pose: &Pose2| {
            verifier.seen_through(guest, pose, map)
                - verifier.seen_through(host, &Pose2::IDENTITY, map)
        };
        let there = beyond(self, query, place, &pose);
        self.submap.rebuild(map, query, &self.limits, 1.0);
        there.max(beyond(self, place, query, &pose.inverse()))
    }

    /// Poses seen from the candidate where the query fits to a share of `enough` at least, and
    /// looks through no walls.
    pub fn possible(
        &mut self,
        query: PatchId,
        candidate: &Candidate,
        enough: f64,
        map: &Map,
    ) -> Vec<Pose2> {
        let mut host = self.host(candidate.patch, map);
        let mut fits = self.fits(&mut host, query, candidate, map);
        fits.retain(|fit| fit.status.is_usable() && fit.inlier_ratio >= enough);
        fits.retain(|fit| !self.looks_through_walls(query, &fit.pose, candidate, map));
        fits.iter().map(|fit| fit.pose).collect()
    }

    /// The best poses of a query, seen from the candidate, refined, those that fit best first. The
    /// candidate's submap is laid for them.
    fn fits(
        &mut self,
        host: &mut Host,
        query: PatchId,
        candidate: &Candidate,
        map: &Map,
    ) -> Vec<MatchResult> {
        let surroundings = self.surroundings(query, map);
        let found = self.search(&surroundings, candidate, host);
        if found.is_empty() {
            return Vec::new();
        }
        self.lay(host, map);
        let mut fits: Vec<MatchResult> =
            found.iter().map(|pose| self.refine(&surroundings, pose)).collect();
        fits.sort_by(|a, b| b.inlier_ratio.total_cmp(&a.inlier_ratio));
        fits
    }

    fn lay(&mut self, host: &mut Host, map: &Map) {
        if !host.is_laid {
            self.submap.lay(map, 1.0);
            host.is_laid = true;
        }
    }

    /// Line points of the query's own local submap, thinned, in the query's frame.
    fn surroundings(&self, query: PatchId, map: &Map) -> Vec<LinePoint> {
        let limits = SubmapLimits {
            distance_m: self.settings.query_distance_m,
            patches: self.settings.query_patches,
            ..self.limits
        };
        let own = map.pose(query);
        let members: Vec<(PatchId, Pose2)> = map
            .manifold
            .local_submap(query, &limits)
            .iter()
            .map(|m| (m.patch, own.between(&map.pose(m.patch))))
            .collect();
        thinned(&members, map, THINNING_M)
    }

    /// Grid poses of the query in the candidate's frame by branch and bound, best first.
    fn search(&self, surroundings: &[LinePoint], candidate: &Candidate, host: &Host) -> Vec<Pose2> {
        let window = self.window(candidate);
        let points: Vec<Vector2<f32>> =
            surroundings.iter().map(|p| Vector2::new(p.x, p.y)).collect();
        let turns = match &host.directions {
            Some(directions) => directions.turns_of(&Directions::of(surroundings.iter().copied())),
            None => vec![Turns { centre: window.centre.yaw, half: window.half_yaw_rad }],
        };
        let settings = SearchSettings {
            min_score: self.settings.min_score,
            candidates: RIVALS,
            max_windows: self.settings.max_windows / turns.len(),
            ..SearchSettings::default()
        };
        let found = |turns: &Turns| {
            let centre = Pose2::new(window.centre.x, window.centre.y, turns.centre);
            let window = SearchWindow { centre, half_yaw_rad: turns.half, ..window };
            host.pyramid.search_many(&points, &window, &settings).candidates
        };
        let mut found: Vec<_> = turns.iter().flat_map(found).collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        found.truncate(RIVALS);
        found.iter().map(|c| c.pose).collect()
    }

    /// Where a candidate's query is searched.
    fn window(&self, candidate: &Candidate) -> SearchWindow {
        let s = &self.settings;
        let belief = &candidate.patch_from_query;
        let half = |i: usize| s.sigmas * belief.covariance[(i, i)].sqrt();
        let (centre, half_m, least_yaw_rad) = match candidate.area {
            SearchArea::Around(half_m) => (Pose2::new(0.0, 0.0, belief.mean.yaw), half_m, 0.3),
            SearchArea::Believed => (belief.mean, self.doubt_m(belief).clamp(0.4, s.window_m), 0.1),
        };
        let half_yaw_rad = half(2).clamp(least_yaw_rad, PI);
        SearchWindow { centre, half_x_m: half_m, half_y_m: half_m, half_yaw_rad }
    }

    fn closure(&self, query: PatchId, candidate: &Candidate, result: MatchResult) -> Closure {
        let belief = &candidate.patch_from_query;
        let shift = belief.mean.between(&result.pose);
        let covariance = belief.covariance + result.covariance;
        let predicted = GaussianPose2 { mean: belief.mean, covariance };
        let surprise = predicted.mahalanobis_squared(&result.pose).unwrap_or(f64::INFINITY);
        let alone = candidate.area == SearchArea::Believed
            && self.doubt_m(belief) <= self.settings.window_m;
        Closure { from: candidate.patch, to: query, result, shift, surprise, alone }
    }

    /// How far from where it is believed the query may be, metres.
    fn doubt_m(&self, belief: &GaussianPose2) -> f64 {
        let std = |i: usize| belief.covariance[(i, i)].sqrt();
        // The covariance is in the query's frame; a square box holds it in any other.
        self.settings.sigmas * std(0).max(std(1))
    }

    /// True when more of the query's sight lines pass through walls than people and doors explain
    /// that moved while the submap was made: its own patches see through those as well.
    fn looks_through_walls(
        &self,
        query: PatchId,
        pose: &Pose2,
        candidate: &Candidate,
        map: &Map,
    ) -> bool {
        let usual = self.seen_through(candidate.patch, &Pose2::IDENTITY, map);
        self.seen_through(query, pose, map) > self.settings.seen_through + usual
    }

    /// Share of a patch's sight lines that pass through walls of the submap.
    fn seen_through(&self, patch: PatchId, anchor_from_patch: &Pose2, map: &Map) -> f64 {
        let laser = map.manifold.patch(patch).base_from_laser;
        self.submap.seen_through(map.surface(patch), anchor_from_patch, &laser)
    }

    fn refine(&self, surroundings: &[LinePoint], pose: &Pose2) -> MatchResult {
        self.matcher.align(&self.submap.field, surroundings, &Prior::guess(*pose))
    }
}

/// True when a refinement went no farther than the surroundings may be bent.
fn is_near(refined: &Pose2, start: &Pose2) -> bool {
    let moved = start.between(refined);
    moved.norm() < 0.5 && moved.yaw.abs() < 0.1
}

/// The surfaces of `members`, one point in each square of side `cell_m`, ordered by square.
fn thinned(members: &[(PatchId, Pose2)], map: &Map, cell_m: f32) -> Vec<LinePoint> {
    let key = |v: f32| ((v / cell_m).floor() as i32).wrapping_sub(i32::MIN / 2) as u32;
    let mut points: Vec<(u64, LinePoint)> = members
        .iter()
        .flat_map(|(patch, pose)| map.surface(*patch).iter().map(LinePoint::mover(pose)))
        .map(|p| ((u64::from(key(p.y)) << 32) | u64::from(key(p.x)), p))
        .collect();
    // Stable: the first point of a square stays.
    points.sort_by_key(|(square, _)| *square);
    points.dedup_by_key(|(square, _)| *square);
    points.into_iter().map(|(_, p)| p).collect()
}
