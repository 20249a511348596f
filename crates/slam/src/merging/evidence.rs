use super::Link;
use super::common_ground::Seen;
use super::recognition::PlaceMatch;
use super::surroundings::Doubt;
use crate::SlamConfig;
use crate::loop_closing::{Candidate, SearchArea, Verifier};
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{GaussianPose2, Matrix3, Vector3};
use manifold::{Islands, PatchId};
use rayon::prelude::*;

/// What was found where two islands overlap, if they lie as a set of matches says.
#[derive(Clone, Debug, Default)]
pub(crate) struct Evidence {
    /// Matches all over the overlap, those of the set included.
    pub links: Vec<PlaceMatch>,
    /// Places of the source that fit, far enough from each other to be independent.
    pub agreeing: usize,
    /// Places where one island sees through the other's walls, counted likewise.
    pub contradicting: usize,
    /// Places of the overlap, all of them.
    pub places: usize,
    /// Of these the ones that fit.
    pub fitting: usize,
    /// Mean share of sight lines that pass through the other island's walls, over all places.
    pub seen_through: f64,
    /// The places of the overlap, each where it fits or, if it does not, is expected.
    pub seen: Vec<Seen>,
}

/// Places nearer to each other than this may owe their fit to the same walls, metres: about the
/// size of a room.
const INDEPENDENT_M: f64 = 5.0;
/// A place is looked at once a match is known within this distance, metres: islands are bent.
const STEP_M: f64 = 8.0;
/// A place is in the overlap when a patch of the target lies this near to it, metres.
const NEAR_M: f64 = 2.0;
/// Share of sight lines through walls that contradicts.
const CONTRADICTION: f64 = 0.15;
/// How well a place is known from the nearest match: next to it, and per metre from it.
const DOUBT_M: f64 = 0.1;
const DOUBT_PER_M: f64 = 0.02;
/// Doubt of the yaw, radians: next to a match, and per metre of doubt.
const DOUBT_RAD: f64 = 0.02;
const DOUBT_RAD_PER_M: f64 = 0.1;

/// Looks at every place of the overlap, from the matches outwards.
pub(super) fn examine(
    map: &Map,
    islands: &Islands,
    set: &[PlaceMatch],
    places: &[PatchId],
    grid: &PatchGrid,
    config: &SlamConfig,
) -> Evidence {
    let mut evidence = Evidence { links: set.to_vec(), ..Evidence::default() };
    let Some(first) = set.first() else { return evidence };
    let target = islands.of[first.from.index()];
    let verifier = Verifier::new(&config.for_merging());
    let mut left: Vec<PatchId> = places.to_vec();
    let (mut agreeing, mut contradicting, mut through) = (Vec::new(), Vec::new(), 0.0);
    loop {
        let expected: Vec<Expected> = left
            .par_iter()
            .filter_map(|&place| expect(map, grid, target, place, &evidence.links))
            .collect();
        if expected.is_empty() {
            break;
        }
        let verdicts: Vec<Verdict> = expected
            .par_iter()
            .map_init(|| verifier.clone(), |verifier, e| judge(verifier, e, map, config))
            .collect();
        evidence.places += expected.len();
        for (e, verdict) in expected.iter().zip(verdicts) {
            through += verdict.through;
            let from_place = verdict.link.map_or(e.near_from_place, |link| link.from_from_to).mean;
            let doubt = verdict.link.map_or(e.doubt(), |_| Doubt::NONE);
            evidence.seen.push(Seen { place: e.place, from: e.near, from_place, doubt });
            match verdict.link {
                Some(link) => {
                    agreeing.push(e.place);
                    evidence.links.push(link);
                }
                None if verdict.through > CONTRADICTION => contradicting.push(e.place),
                None => {}
            }
        }
        left.retain(|place| !expected.iter().any(|e| e.place == *place));
    }
    evidence.fitting = agreeing.len();
    evidence.seen_through = through / evidence.places.max(1) as f64;
    evidence.agreeing = independent(map, &agreeing);
    evidence.contradicting = independent(map, &contradicting);
    evidence
}

/// A place of the source where it is expected in the target.
#[derive(Clone, Copy, Debug)]
struct Expected {
    place: PatchId,
    /// The patch of the target that sees most of the same.
    near: PatchId,
    near_from_place: GaussianPose2,
}

impl Expected {
    /// What the place may be off, if it does not fit.
    fn doubt(&self) -> Doubt {
        let std = |i: usize| self.near_from_place.covariance[(i, i)].sqrt() as f32;
        Doubt { std_m: std(0), std_rad: std(2) }
    }
}

/// What a place says.
struct Verdict {
    /// The match, where it fits.
    link: Option<PlaceMatch>,
    /// Share of sight lines that pass through walls.
    through: f64,
}

/// Where a place is expected by way of the nearest match; `None` when that is too far, or when the
/// target does not know the place.
fn expect(
    map: &Map,
    grid: &PatchGrid,
    target: u32,
    place: PatchId,
    links: &[PlaceMatch],
) -> Option<Expected> {
    let own = map.pose(place);
    let distance = |link: &PlaceMatch| map.pose(link.to).distance(&own);
    let link = links.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    if distance(link) > STEP_M {
        return None;
    }
    let pose = link.link().target_from_source(map) * own;
    let seen_from = |patch: PatchId| map.pose(patch).between(&pose);
    let unlike = |patch: &PatchId| {
        let there = seen_from(*patch);
        there.norm() + there.yaw.abs()
    };
    let same_floor = |near: &PatchId| {
        link.link().agrees_in_height(&Link { from: *near, to: place, ..link.link() }, map)
    };
    let near = grid
        .within(map, target, &pose, NEAR_M)
        .into_iter()
        .filter(same_floor)
        .min_by(|a, b| unlike(a).total_cmp(&unlike(b)))?;
    let doubt_m = DOUBT_M + DOUBT_PER_M * distance(link);
    let std = Vector3::new(doubt_m, doubt_m, DOUBT_RAD + DOUBT_RAD_PER_M * doubt_m);
    let covariance = Matrix3::from_diagonal(&std.component_mul(&std));
    let near_from_place = GaussianPose2 { mean: seen_from(near), covariance };
    Some(Expected { place, near, near_from_place })
}

fn judge(verifier: &mut Verifier, e: &Expected, map: &Map, config: &SlamConfig) -> Verdict {
    let patch_from_query = e.near_from_place;
    let candidate = Candidate { patch: e.near, patch_from_query, area: SearchArea::Believed };
    let mut host = verifier.host(e.near, map);
    let found = verifier.verify_at(&mut host, e.place, &candidate, map).ok();
    let link = found.map(|closure| PlaceMatch::new(e.near, e.place, &closure.result, config));
    let pose = link.map_or(e.near_from_place.mean, |link| link.from_from_to.mean);
    let through = verifier.contradiction_in(host, e.place, e.near, &pose, map).max(0.0);
    Verdict { link, through }
}

/// How many of some places are far enough from each other to be independent, the first ones first:
/// storeys are.
fn independent(map: &Map, places: &[PatchId]) -> usize {
    let mut chosen: Vec<PatchId> = Vec::new();
    for &place in places {
        let pose = map.pose(place);
        let apart = |c: &PatchId| {
            map.pose(*c).distance(&pose) >= INDEPENDENT_M || map.manifold.apart_in_height(*c, place)
        };
        if chosen.iter().all(apart) {
            chosen.push(place);
        }
    }
    chosen.len()
}
