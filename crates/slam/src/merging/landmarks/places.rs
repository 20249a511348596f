use super::alignment::point_jacobian;
use super::consensus::GATE_CHI2;
use super::island::{IslandLandmark, IslandLandmarks, turned};
use geometry::{Matrix2, Vector2};
use manifold::{Islands, Manifold, PatchId, PatchSighting};
use sensing::{LandmarkKind, RobotId};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// Of an id seen more often on one island, so many sightings are looked at, evenly spread.
const MOST_SIGHTINGS: usize = 256;
/// An id that is seen at more places says nothing about any of them: those seen most often are
/// kept.
const MOST_PLACES: usize = 4;
/// Landmarks without id that are told apart on one island.
const MOST_UNNAMED: usize = 64;
/// Sightings that may be of one landmark lie this near to each other in the map beside their
/// covariances, metres: the 95 % interval up to which patches make a local submap.
const BENT_M: f64 = 0.3;
/// Side of the cells in which an island's area is counted, metres.
const CELL_M: f64 = 1.0;
/// A sighting's part in the area is at most this wide to each side, metres.
const FARTHEST_M: f64 = 20.0;

/// The places of all landmarks that stand still, island by island.
pub(crate) fn places_of(manifold: &Manifold, islands: &Islands) -> Vec<Vec<IslandLandmark>> {
    let mut seen: Vec<Vec<&PatchSighting>> = vec![Vec::new(); islands.members.len()];
    for sighting in manifold.sightings() {
        seen[islands.of(sighting.patch)].push(sighting);
    }
    seen.iter().map(|sightings| places_among(manifold, sightings)).collect()
}

/// The places of all landmarks that stand still, among sightings on one island.
pub(crate) fn places_among(
    manifold: &Manifold,
    sightings: &[&PatchSighting],
) -> Vec<IslandLandmark> {
    let mut groups: BTreeMap<_, Vec<&PatchSighting>> = BTreeMap::new();
    for &seen in sightings {
        let (kind, id) = (seen.sighting.kind, seen.sighting.id.as_deref());
        if kind != LandmarkKind::Robot && !manifold.patch(seen.patch).left_out {
            groups.entry((kind, id)).or_default().push(seen);
        }
    }
    let most = |named: bool| if named { MOST_PLACES } else { MOST_UNNAMED };
    let told = groups.iter().map(|((_, id), all)| told_apart(manifold, all, most(id.is_some())));
    told.flatten().collect()
}

/// The places at which one id was seen, or all landmarks of a kind without ids, those seen most
/// often.
fn told_apart(manifold: &Manifold, all: &[&PatchSighting], most: usize) -> Vec<IslandLandmark> {
    let step = all.len().div_ceil(MOST_SIGHTINGS);
    let mut left: Vec<&PatchSighting> = all.iter().copied().step_by(step.max(1)).collect();
    let mut places = Vec::new();
    while let Some(seed) = most_confirmed(manifold, &left) {
        let (members, rest) = split(manifold, left[seed], &left);
        left = rest;
        places.extend(fuse(manifold, &members));
        if places.len() >= 2 * MOST_UNNAMED {
            break;
        }
    }
    places.sort_by_key(|place| std::cmp::Reverse(place.sightings));
    places.truncate(most);
    places
}

/// The sighting that most others confirm as the map now is, the most accurate of several.
fn most_confirmed(manifold: &Manifold, sightings: &[&PatchSighting]) -> Option<usize> {
    let spots: Vec<(Vector2<f64>, Matrix2<f64>)> = sightings
        .iter()
        .map(|s| {
            let pose = manifold.patch(s.patch).island_from_patch;
            let covariance = turned(&s.sighting.covariance, pose.yaw);
            (pose.transform(s.sighting.position), covariance)
        })
        .collect();
    let confirms = |a: &(Vector2<f64>, Matrix2<f64>), b: &(Vector2<f64>, Matrix2<f64>)| {
        let bent = Matrix2::identity() * (BENT_M * BENT_M);
        let offset = a.0 - b.0;
        (a.1 + b.1 + bent).try_inverse().is_some_and(|i| offset.dot(&(i * offset)) <= GATE_CHI2[1])
    };
    let count = |i: usize| spots.iter().filter(|other| confirms(&spots[i], other)).count();
    (0..spots.len()).map(|i| (count(i), -spots[i].1.trace(), i)).max_by(ranked).map(|best| best.2)
}

fn ranked(a: &(usize, f64, usize), b: &(usize, f64, usize)) -> std::cmp::Ordering {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(b.2.cmp(&a.2))
}

/// A sighting as its seed's patch sees it.
struct Member<'a> {
    seen: &'a PatchSighting,
    position: Vector2<f64>,
    covariance: Matrix2<f64>,
}

/// The sightings that may be of the seed's landmark, the way between the patches considered, the
/// seed first; and the others.
fn split<'a>(
    manifold: &Manifold,
    seed: &'a PatchSighting,
    sightings: &[&'a PatchSighting],
) -> (Vec<Member<'a>>, Vec<&'a PatchSighting>) {
    let wanted: Vec<PatchId> = sightings.iter().map(|s| s.patch).collect();
    let known = manifold.uncertainty_from(seed.patch, &wanted);
    let own = manifold.patch(seed.patch).island_from_patch;
    let first = seed.sighting.position;
    let of_seed = seed.sighting.covariance;
    let mut members = vec![Member { seen: seed, position: first, covariance: of_seed }];
    let mut rest = Vec::new();
    for &seen in sightings.iter().filter(|s| !std::ptr::eq(**s, seed)) {
        let Some(way) = known[seen.patch.index()] else { continue };
        let pose = own.between(&manifold.patch(seen.patch).island_from_patch);
        let position = pose.transform(seen.sighting.position);
        let jacobian = point_jacobian(&pose, &seen.sighting.position);
        // An id says that it is the same thing, however far it has drifted; without one the map
        // does.
        let drift = match seed.sighting.id {
            Some(_) => jacobian * way.covariance * jacobian.transpose(),
            None => Matrix2::identity() * (BENT_M * BENT_M),
        };
        let covariance = turned(&seen.sighting.covariance, pose.yaw) + drift;
        let offset = position - first;
        let inverse = (covariance + of_seed).try_inverse();
        if inverse.is_some_and(|i| offset.dot(&(i * offset)) <= GATE_CHI2[1]) {
            members.push(Member { seen, position, covariance });
        } else {
            rest.push(seen);
        }
    }
    (members, rest)
}

/// One place from its sightings, seen from the first one's patch.
///
/// Sightings from one patch share their errors (the mounting, the patch's pose): all together they
/// count as one of their average covariance. Where sightings scatter more than they claim, the
/// result claims as much less (Birge 1932, "The calculation of errors by the method of least
/// squares").
fn fuse(manifold: &Manifold, members: &[Member]) -> Option<IslandLandmark> {
    let first = members.first()?.seen;
    let mut by_patch: BTreeMap<PatchId, (f64, Vector2<f64>, Matrix2<f64>)> = BTreeMap::new();
    for m in members {
        let sum = by_patch
            .entry(m.seen.patch)
            .or_insert_with(|| (0.0, Vector2::zeros(), Matrix2::zeros()));
        *sum = (sum.0 + 1.0, sum.1 + m.position, sum.2 + m.covariance);
    }
    let (mut information, mut vector) = (Matrix2::zeros(), Vector2::zeros());
    for (count, position, covariance) in by_patch.values() {
        let weight = (covariance / *count).try_inverse()?;
        information += weight;
        vector += weight * (position / *count);
    }
    let covariance = information.try_inverse()?;
    let position = covariance * vector;
    let excess = |m: &Member| {
        let offset = m.position - position;
        m.covariance.try_inverse().map_or(0.0, |i| offset.dot(&(i * offset)))
    };
    let robots: BTreeSet<RobotId> =
        members.iter().map(|m| manifold.patch(m.seen.patch).robot).collect();
    let freedom = 2.0 * members.len() as f64 - 2.0;
    let scatter = members.iter().map(excess).sum::<f64>() / freedom.max(1.0);
    Some(IslandLandmark {
        kind: first.sighting.kind,
        id: first.sighting.id.clone(),
        patch: first.patch,
        island_from_patch: manifold.patch(first.patch).island_from_patch,
        position,
        covariance: covariance * scatter.max(1.0),
        yaw: None,
        sightings: members.len(),
        robots: robots.into_iter().collect(),
    })
}

/// An island's landmarks with what the ways between them add.
pub(crate) fn with_drift(
    manifold: &Manifold,
    landmarks: Vec<IslandLandmark>,
    area_m2: f64,
) -> IslandLandmarks {
    let patches: Vec<PatchId> = landmarks.iter().map(|l| l.patch).collect();
    let count = landmarks.len();
    let mut drift = vec![Matrix2::zeros(); count * count];
    let mut known = BTreeMap::new();
    for &patch in &patches {
        known.entry(patch).or_insert_with(|| manifold.uncertainty_from(patch, &patches));
    }
    for (a, &patch) in patches.iter().enumerate() {
        for (b, landmark) in landmarks.iter().enumerate() {
            let Some(way) = known[&patch][landmark.patch.index()] else { continue };
            let jacobian = point_jacobian(&landmark.island_from_patch, &landmark.position);
            let half = jacobian * way.covariance * jacobian.transpose() * 0.5;
            // Seen from either end: the way is the same.
            drift[a * count + b] += half;
            drift[b * count + a] += half;
        }
    }
    IslandLandmarks { landmarks, drift, area_m2 }
}

/// The area an island's sightings cover, m^2: the square metres within reach of a patch from which
/// something was seen, reach being how far landmarks were seen on average.
pub(crate) fn area_of(
    manifold: &Manifold,
    landmarks: &[IslandLandmark],
    patches: &[PatchId],
) -> f64 {
    let squares: f64 = landmarks.iter().map(|l| l.position.norm_squared()).sum();
    let reach = (squares / landmarks.len().max(1) as f64).sqrt().clamp(CELL_M, FARTHEST_M);
    let radius = (reach / CELL_M).ceil() as i64;
    let cell = |v: f64| (v / CELL_M).floor() as i64;
    let centres: BTreeSet<(i64, i64)> = patches
        .iter()
        .map(|&p| manifold.patch(p).island_from_patch)
        .map(|pose| (cell(pose.x), cell(pose.y)))
        .collect();
    let mut cells = BTreeSet::new();
    for (x, y) in centres {
        for dx in -radius..=radius {
            let half = ((radius * radius - dx * dx) as f64).sqrt() as i64;
            cells.extend((-half..=half).map(|dy| (x + dx, y + dy)));
        }
    }
    (cells.len() as f64 * CELL_M * CELL_M).max(PI * reach * reach)
}
