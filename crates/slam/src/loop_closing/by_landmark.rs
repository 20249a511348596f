use super::verification::Verifier;
use super::{Candidate, Closure, SearchArea};
use crate::SlamConfig;
use crate::map::Map;
use crate::merging::{GATE_CHI2, Link, point_jacobian, revisit, turned};
use geometry::{GaussianPose2, LieGroup, Matrix2, Matrix3};
use manifold::{INTERVAL_95, PatchId, PatchSighting, Provenance};
use sensing::LandmarkKind;
use std::collections::BTreeMap;

/// Closes loops where a landmark is seen again (thesis, algorithm 5.3).
pub(crate) struct LandmarkCloser {
    config: SlamConfig,
    verifier: Verifier,
    /// The patch from which each landmark's return was last looked into.
    looked: BTreeMap<(LandmarkKind, Option<String>), PatchId>,
}

/// A landmark seen so many patches ago is seen again; nearer by it never left.
const RETURN_PATCHES: u32 = 30;
/// The same landmark is looked into again after so many patches.
const PATIENCE_PATCHES: u32 = 10;
/// What the robot saw on so many patches lies together well enough to be compared as one.
const RECENT_PATCHES: u32 = 20;
/// Of earlier sightings without id so many are looked at, evenly spread.
const MOST_UNNAMED: usize = 100;
/// Sightings without id farther apart than this on the map are not of one thing, metres.
const ONE_PLACE_M: f64 = 1.0;
/// Two places of a landmark differ by at least so much, m^2: two maps of one wall differ by 2 cm.
const FLOOR_M2: f64 = 4e-4;
/// Where the heading is known less well than this, the landmark moves the belief too far for its
/// derivative, radians.
const LINEAR_RAD: f64 = 0.5;

impl LandmarkCloser {
    pub fn new(config: &SlamConfig) -> Self {
        let (config, verifier) = (*config, Verifier::new(config));
        LandmarkCloser { config, verifier, looked: BTreeMap::new() }
    }

    /// Links to where the landmarks just noted, from `first` on in the manifold's list, were seen
    /// before: by a match of the scans where they match, else by two landmarks or more.
    pub fn search(&mut self, first: usize, map: &Map) -> Vec<Link> {
        let all = map.manifold.sightings();
        let Some(query) = all[first..].last().map(|s| s.patch) else { return Vec::new() };
        if !self.config.merging.landmarks.enabled {
            return Vec::new();
        }
        let mut returned = false;
        for seen in &all[first..] {
            let Some(old) = self.returns_to(seen, map) else { continue };
            let Some(believed) = vague_belief(map, old.patch, query, &self.config) else {
                continue;
            };
            returned = true;
            if let Some(closure) = self.overlay(old, seen, &believed, map) {
                return vec![self.link(&closure)];
            }
        }
        if !returned {
            return Vec::new();
        }
        let age = |s: &&PatchSighting| query.0.saturating_sub(s.patch.0);
        let old: Vec<_> = all.iter().filter(|s| age(s) >= RETURN_PATCHES).collect();
        let recent: Vec<_> = all.iter().filter(|s| age(s) <= RECENT_PATCHES).collect();
        revisit(map, &old, &recent, &self.config)
    }

    /// The best earlier sighting of a landmark that comes back; notes that it was looked into.
    fn returns_to<'a>(&mut self, seen: &PatchSighting, map: &'a Map) -> Option<&'a PatchSighting> {
        let (kind, id) = (seen.sighting.kind, seen.sighting.id.as_deref());
        let key = (kind, id.map(str::to_owned));
        let waits = |last: &PatchId| seen.patch.0 < last.0 + PATIENCE_PATCHES;
        if kind == LandmarkKind::Robot || self.looked.get(&key).is_some_and(waits) {
            return None;
        }
        let earlier = map.manifold.sightings().iter().filter(|s| {
            s.sighting.kind == kind
                && s.sighting.id.as_deref() == id
                && s.patch.0 + RETURN_PATCHES <= seen.patch.0
        });
        let mut earlier: Vec<&PatchSighting> = earlier.collect();
        if earlier.is_empty() {
            return None;
        }
        self.looked.insert(key, seen.patch);
        if id.is_none() {
            earlier = the_only_place(earlier, seen, map);
        }
        let doubt = |s: &&PatchSighting| s.sighting.covariance.trace();
        earlier.into_iter().min_by(|a, b| doubt(a).total_cmp(&doubt(b)))
    }

    /// Lays the patches onto each other by the landmark and matches the scan with the local submap
    /// of the first (algorithm 5.3, lines 1 to 4).
    ///
    /// The landmark updates what is believed by the way between the patches. A landmark that is
    /// not where that says is refused: its id is wrong, or it was moved.
    fn overlay(
        &mut self,
        old: &PatchSighting,
        seen: &PatchSighting,
        believed: &GaussianPose2,
        map: &Map,
    ) -> Option<Closure> {
        if !self.config.merging.landmarks.match_scans {
            return None;
        }
        let updated = update(believed, old, seen)?;
        let area = SearchArea::Believed;
        let candidate = Candidate { patch: old.patch, patch_from_query: updated, area };
        let mut closure = self.verifier.verify(seen.patch, &candidate, map).ok()?;
        let covariance = believed.covariance + closure.result.covariance;
        let by_way = GaussianPose2 { covariance, ..*believed };
        closure.surprise = by_way.mahalanobis_squared(&closure.result.pose)?;
        closure.shift = believed.mean.between(&closure.result.pose);
        let relation = self.link(&closure).from_from_to;
        let (error, spread) = residual(&relation, old, seen);
        let apart = error.dot(&(spread.try_inverse()? * error));
        let agrees = closure.surprise <= GATE_CHI2[2] && apart <= GATE_CHI2[1];
        (agrees && closure.alone).then_some(closure)
    }

    fn link(&self, closure: &Closure) -> Link {
        let from_from_to = self.config.closure_relation(&closure.result);
        let (from, to) = (closure.from, closure.to);
        Link { from, to, from_from_to, provenance: Provenance::Landmark }
    }
}

/// Of earlier sightings without an id those that may be of the landmark seen, by the way between;
/// none where they lie at several places.
fn the_only_place<'a>(
    earlier: Vec<&'a PatchSighting>,
    seen: &PatchSighting,
    map: &Map,
) -> Vec<&'a PatchSighting> {
    let step = earlier.len().div_ceil(MOST_UNNAMED).max(1);
    let looked_at: Vec<&PatchSighting> = earlier.into_iter().step_by(step).collect();
    let wanted: Vec<PatchId> = looked_at.iter().map(|s| s.patch).collect();
    let known = map.manifold.uncertainty_from(seen.patch, &wanted);
    let here = map.pose(seen.patch);
    let may_be = |old: &&PatchSighting| {
        let Some(way) = known[old.patch.index()] else { return false };
        let mean = here.between(&map.pose(old.patch));
        let believed = GaussianPose2 { mean, ..way }.inverse();
        let (error, spread) = residual(&believed, old, seen);
        spread.try_inverse().is_some_and(|i| error.dot(&(i * error)) <= GATE_CHI2[1])
    };
    let possible: Vec<&PatchSighting> = looked_at.into_iter().filter(may_be).collect();
    let place = |s: &PatchSighting| map.pose(s.patch).transform(s.sighting.position);
    let alike = |s: &&PatchSighting| (place(s) - place(possible[0])).norm() < ONE_PLACE_M;
    if possible.iter().all(alike) { possible } else { Vec::new() }
}

/// What is believed of a patch seen from an older one, by the way between; `None` where that is
/// known so well that they share a local submap.
fn vague_belief(
    map: &Map,
    old: PatchId,
    query: PatchId,
    config: &SlamConfig,
) -> Option<GaussianPose2> {
    let way = map.manifold.uncertainty_from(old, &[query])[query.index()]?;
    let interval = |i: usize| INTERVAL_95 * way.covariance[(i, i)].sqrt();
    let limits = &config.submap;
    let precise =
        interval(0).max(interval(1)) < limits.translation_m && interval(2) < limits.rotation_rad;
    let mean = map.pose(old).between(&map.pose(query));
    (!precise).then_some(GaussianPose2 { mean, ..way })
}

/// How far from the older sighting a pose puts the new one, and the covariance of that.
fn residual(
    pose: &GaussianPose2,
    old: &PatchSighting,
    seen: &PatchSighting,
) -> (geometry::Vector2<f64>, Matrix2<f64>) {
    let (was, is) = (&old.sighting, &seen.sighting);
    let jacobian = point_jacobian(&pose.mean, &is.position);
    let spread = was.covariance
        + turned(&is.covariance, pose.mean.yaw)
        + jacobian * pose.covariance * jacobian.transpose()
        + Matrix2::identity() * FLOOR_M2;
    (was.position - pose.mean.transform(is.position), spread)
}

/// A belief after the landmark: Kalman's update.
fn update(
    believed: &GaussianPose2,
    old: &PatchSighting,
    seen: &PatchSighting,
) -> Option<GaussianPose2> {
    if believed.covariance[(2, 2)] > LINEAR_RAD * LINEAR_RAD {
        return None;
    }
    let (error, spread) = residual(believed, old, seen);
    let inverse = spread.try_inverse()?;
    if error.dot(&(inverse * error)) > GATE_CHI2[1] {
        return None;
    }
    let jacobian = point_jacobian(&believed.mean, &seen.sighting.position);
    let gain = believed.covariance * jacobian.transpose() * inverse;
    let covariance = (Matrix3::identity() - gain * jacobian) * believed.covariance;
    let covariance = 0.5 * (covariance + covariance.transpose());
    Some(GaussianPose2 { mean: believed.mean.retract(&(gain * error)), covariance })
}
