use super::LandmarkSettings;
use super::alignment::{Islands, Pairing};
use super::bound::{Shared, pattern_bound};
use super::consensus::{Consensus, consensus, misfit};
use super::island::{IslandLandmark, IslandLandmarks};
use super::misread::{by_accident, misread_pairings};
use geometry::GaussianPose2;
use sensing::LandmarkKind;
use std::collections::{BTreeMap, BTreeSet};

/// How two islands lie to each other by their landmarks, and what speaks for it.
#[derive(Clone, Debug, PartialEq)]
pub struct LandmarkAlignment {
    /// The source island's frame seen from the target's.
    pub target_from_source: GaussianPose2,
    /// The landmarks that cover each other: their indices on target and source.
    pub pairs: Vec<(usize, usize)>,
    /// Ids known on both islands that do not fit.
    pub refused: usize,
    /// Size of the largest set of landmarks that says something else.
    pub rival: usize,
    /// Bound on the chance that the alignment is wrong; 1 where it is ambiguous or too vague.
    pub false_bound: f64,
}

/// Most pairs of landmarks that are compared; beyond, ids that occur at most places are left out.
const MOST_PAIRINGS: usize = 400;
/// Landmarks without ids whose pattern is the same on both islands, at least.
const LEAST_PATTERN: usize = 4;
/// An alignment whose yaw is known less well than this places far ends of an island metres apart,
/// radians: the 95 % interval is that of local submaps.
const LARGEST_YAW_STD_RAD: f64 = 0.1;
/// Chance that a robot is taken for another: they know each other by radio, not by looks.
const WRONG_ROBOTS: f64 = 0.005;

/// Compares the landmarks of two islands: those with ids by their ids, those without by the place
/// the others give them, or by their pattern where nothing else tells.
///
/// After algorithm 5.5 of the thesis, lines 1 to 12, with the errata's closed-form alignment and
/// outlier rejection. `None` where no two landmarks agree.
pub fn compare_landmarks(
    target: &IslandLandmarks,
    source: &IslandLandmarks,
    settings: &LandmarkSettings,
) -> Option<LandmarkAlignment> {
    let islands = Islands { target, source };
    by_ids(&islands, settings).or_else(|| by_pattern(&islands))
}

fn by_ids(islands: &Islands, settings: &LandmarkSettings) -> Option<LandmarkAlignment> {
    let pairings = named_pairings(islands);
    let id = |p: &Pairing| name_of(&islands.source.landmarks[p.source]);
    let ids: BTreeSet<_> = pairings.iter().map(id).collect();
    let mut set = consensus(islands, &pairings)?;
    let of_robots = |p: &Pairing| islands.source.landmarks[p.source].kind == LandmarkKind::Robot;
    let shared = if set.members.iter().all(of_robots) {
        Shared { ids: ids.len(), wrong: WRONG_ROBOTS, unrelated: 0.0 }
    } else {
        Shared::tags(ids.len(), settings.wrong_ids)
    };
    let mut false_bound = shared.false_bound(islands, &set, &pairings);
    let agreeing: BTreeSet<_> = set.members.iter().map(id).collect();
    let refused = ids.len() - agreeing.len();
    let ambiguous = set.rival >= set.members.len();
    if !ambiguous {
        // Where ids say enough by themselves nothing is risked.
        let misread = misread_pairings(islands, &set);
        if false_bound > settings.false_merges
            && let Some(ratio) = by_accident(islands, &set, &misread, shared.wrong)
        {
            false_bound *= ratio.powi(add(islands, &mut set, misread) as i32);
        }
        add(islands, &mut set, unnamed_pairings(islands));
    }
    Some(conclude(set, refused, false_bound))
}

/// The pattern of landmarks without ids, of many alone.
fn by_pattern(islands: &Islands) -> Option<LandmarkAlignment> {
    let pairings = unnamed_pairings(islands);
    if pairings.len() > MOST_PAIRINGS {
        return None;
    }
    let set = consensus(islands, &pairings).filter(|set| set.members.len() >= LEAST_PATTERN)?;
    let false_bound = pattern_bound(islands, &set);
    Some(conclude(set, 0, false_bound))
}

fn conclude(set: Consensus, refused: usize, false_bound: f64) -> LandmarkAlignment {
    let vague = set.target_from_source.covariance[(2, 2)].sqrt() > LARGEST_YAW_STD_RAD;
    let ambiguous = set.rival >= set.members.len();
    LandmarkAlignment {
        target_from_source: set.target_from_source,
        pairs: set.members.iter().map(|p| (p.target, p.source)).collect(),
        refused,
        rival: set.rival,
        false_bound: if vague || ambiguous { 1.0 } else { false_bound },
    }
}

fn name_of(landmark: &IslandLandmark) -> (LandmarkKind, Option<&str>) {
    (landmark.kind, landmark.id.as_deref())
}

/// All pairs with the same id, those of ids that occur at fewest places first.
fn named_pairings(islands: &Islands) -> Vec<Pairing> {
    let mut by_name: BTreeMap<_, Vec<Pairing>> = BTreeMap::new();
    for (source, s) in islands.source.landmarks.iter().enumerate() {
        for (target, t) in islands.target.landmarks.iter().enumerate() {
            if s.id.is_some() && name_of(s) == name_of(t) {
                by_name.entry(name_of(s)).or_default().push(Pairing { target, source });
            }
        }
    }
    let mut groups: Vec<Vec<Pairing>> = by_name.into_values().collect();
    groups.sort_by_key(Vec::len);
    let mut pairings = Vec::new();
    for group in groups {
        if pairings.len() + group.len() <= MOST_PAIRINGS {
            pairings.extend(group);
        }
    }
    pairings.sort_unstable();
    pairings
}

fn unnamed_pairings(islands: &Islands) -> Vec<Pairing> {
    let mut pairings = Vec::new();
    for (target, t) in islands.target.landmarks.iter().enumerate() {
        for (source, s) in islands.source.landmarks.iter().enumerate() {
            if s.id.is_none() && t.id.is_none() && s.kind == t.kind {
                pairings.push(Pairing { target, source });
            }
        }
    }
    pairings
}

/// Takes in further landmarks that cover each other, each the only one that does, and says how
/// many. They make the alignment more accurate; those without ids do not make it more certain.
fn add(islands: &Islands, set: &mut Consensus, pairings: Vec<Pairing>) -> usize {
    let Some(from) = islands.middle(&set.members) else { return 0 };
    let fits = |p: &Pairing| misfit(islands, *p, from, &set.target_from_source, false).is_some();
    let fitting: Vec<Pairing> = pairings.into_iter().filter(fits).collect();
    let alone = |p: &&Pairing| {
        let rivals = fitting.iter().filter(|q| q.target == p.target || q.source == p.source);
        rivals.count() == 1
    };
    let mut members = set.members.clone();
    members.extend(fitting.iter().filter(alone));
    members.sort_unstable();
    let added = members.len() - set.members.len();
    let Some(alignment) = islands.align(&members) else { return 0 };
    set.target_from_source = alignment;
    set.members = members;
    added
}
