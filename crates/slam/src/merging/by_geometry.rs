use super::common_ground::{CommonGround, Seen};
use super::estimate::{
    MOST_SPREAD, MOST_SQUARES, Observed, Usual, beyond_a_copy, decades, may_suffice,
};
use super::evidence::{Evidence, examine};
use super::places::PlaceIndex;
use super::recognition::{PlaceMatch, Recognition};
use super::sets::agreeing_sets;
use super::usual::usual;
use super::{EvidenceCounts, Link, Proposal, say_the_same};
use crate::SlamConfig;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{Pose2, Vector2};
use manifold::{Islands, PatchId};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cells of the grid that patches are looked up in, metres.
const GRID_M: f64 = 4.0;
/// Place recognition between islands: matches are found once, and grouped anew as islands join.
pub(super) struct GeometricMerging {
    index: PlaceIndex,
    recognition: Recognition,
    matches: Vec<PlaceMatch>,
    /// How many matches there were before the last look.
    known: usize,
    usual: Usual,
}

impl GeometricMerging {
    /// Finds places on all islands; none is compared yet.
    pub fn new(map: &Map, config: &SlamConfig) -> Self {
        let islands = map.manifold.component_map();
        let spacing_m = config.merging.spacing_m;
        let index = PlaceIndex::new(map, &islands, &config.submap, spacing_m);
        let recognition = Recognition::new(map, &index, &config.merging);
        let usual = usual(map, &islands, &PatchGrid::new(map, &islands, GRID_M), config);
        GeometricMerging { index, recognition, matches: Vec::new(), known: 0, usual }
    }

    /// Compares more places of islands that are still apart; false when all were compared.
    pub fn look(&mut self, map: &Map, islands: &Islands, config: &SlamConfig) -> bool {
        self.known = self.matches.len();
        let found = self.recognition.next_pass(map, islands, config);
        self.matches.extend(found.iter().flatten());
        found.is_some()
    }

    /// True when this was the last look.
    pub fn is_last(&self) -> bool {
        self.recognition.is_done()
    }

    /// Comparisons made.
    pub fn tried(&self) -> usize {
        self.recognition.tried
    }

    /// Pairs of islands whose matches agree, of which one at least is new or has a match that the
    /// last look found, if `looked`.
    pub fn pairs(
        &self,
        map: &Map,
        islands: &Islands,
        is_new: impl Fn(usize) -> bool,
        looked: bool,
        config: &SlamConfig,
    ) -> Vec<IslandPair> {
        let mut pairs: BTreeMap<(usize, usize), (bool, Vec<PlaceMatch>)> = BTreeMap::new();
        for (index, m) in self.matches.iter().enumerate() {
            let m = larger_first(*m, islands);
            let (target, source) = (islands.of(m.from), islands.of(m.to));
            if target != source {
                let (is_due, matches) = pairs.entry((target, source)).or_default();
                *is_due |= is_new(target) || is_new(source) || looked && index >= self.known;
                matches.push(m);
            }
        }
        let pairs: Vec<Vec<PlaceMatch>> =
            pairs.into_values().filter_map(|(is_due, matches)| is_due.then_some(matches)).collect();
        let agreeing = |matches: Vec<PlaceMatch>| {
            let mut sets: Vec<Vec<PlaceMatch>> = by_height(map, &matches)
                .iter()
                .flat_map(|group| agreeing_sets(map, group, config.merging.least_agreeing))
                .collect();
            sets.sort_by_key(|set| std::cmp::Reverse(set.len()));
            (!sets.is_empty()).then_some(IslandPair { matches, sets })
        };
        pairs.into_par_iter().filter_map(agreeing).collect()
    }

    /// How the islands of some pairs may lie to each other.
    pub fn propose(
        &self,
        map: &Map,
        islands: &Islands,
        pairs: &[IslandPair],
        config: &SlamConfig,
    ) -> Vec<Proposal> {
        let grid = PatchGrid::new(map, islands, GRID_M);
        let mut places: Vec<Vec<PatchId>> = vec![Vec::new(); islands.members.len()];
        for place in &self.index.places {
            places[islands.of(place.patch)].push(place.patch);
        }
        let best = |pair: &IslandPair| {
            let source = &places[pair.ends(islands).1];
            let look =
                |set: &Vec<_>| (set.len(), examine(map, islands, set, source, &grid, config));
            let examined: Vec<(usize, Evidence)> = pair.sets.iter().map(look).collect();
            let weighed = self.weighed(map, islands, &grid, examined);
            choose(map, weighed, config.merging.false_merges)
        };
        pairs.par_iter().filter_map(best).collect()
    }

    /// How sure the alignments of two islands are. Surfaces are compared where one may suffice: of
    /// all, for the others are its rivals.
    fn weighed(
        &self,
        map: &Map,
        islands: &Islands,
        grid: &PatchGrid,
        examined: Vec<(usize, Evidence)>,
    ) -> Vec<Alignment> {
        let compared = examined.iter().any(|(_, e)| may_suffice(&observed(e), &self.usual));
        let weigh = |(matches, evidence): (usize, Evidence)| {
            let mut observed = observed(&evidence);
            if compared {
                let everything = |_: &Seen, _: PatchId, _: bool| true;
                observed.add(CommonGround::of(map, grid, &islands.of, &evidence.seen, everything));
            }
            let counts = counted(matches, &evidence, &observed);
            let bound = 10f64.powf(decades(&observed, &self.usual));
            let links = evidence.links.iter().map(PlaceMatch::link).collect();
            Alignment { links, counts, bound }
        };
        examined.into_iter().map(weigh).collect()
    }
}

impl Observed {
    /// Adds what surfaces say.
    fn add(&mut self, mut ground: CommonGround) {
        ground.squares.truncate(MOST_SQUARES);
        ground.spread.truncate(MOST_SPREAD);
        let squares: Vec<_> = ground.squares.iter().map(|&middle| (middle, 1.0)).collect();
        self.compared_m = ground.compared_m;
        self.beyond_m = beyond_a_copy(&ground.spread);
        self.contradicted_m = ground.contradicted_m;
        self.pieces = ground.pieces;
        self.squares = squares.len();
        self.beyond = beyond_a_copy(&squares).round() as usize;
    }
}

/// What the places say.
fn observed(evidence: &Evidence) -> Observed {
    Observed {
        agreeing: evidence.agreeing,
        contradicting: evidence.contradicting,
        seen_through: evidence.seen_through,
        ..Observed::default()
    }
}

fn counted(matches: usize, evidence: &Evidence, observed: &Observed) -> EvidenceCounts {
    EvidenceCounts {
        matches,
        agreeing: evidence.agreeing,
        contradicting: evidence.contradicting,
        places: evidence.places,
        fitting: evidence.fitting,
        seen_through_per_mille: (1000.0 * evidence.seen_through).round() as u32,
        compared_m: observed.compared_m.round() as u32,
        beyond_m: observed.beyond_m.round() as u32,
        pieces: observed.pieces,
        contradicted_cm: (100.0 * observed.contradicted_m).round() as u32,
        squares: observed.squares,
        beyond: observed.beyond,
    }
}

/// Two islands with their matches.
pub(super) struct IslandPair {
    /// All of them, from the target to the source.
    matches: Vec<PlaceMatch>,
    /// Those that agree, the largest set first; at least one.
    sets: Vec<Vec<PlaceMatch>>,
}

impl IslandPair {
    /// The indices of the two islands, target first.
    pub fn ends(&self, islands: &Islands) -> (usize, usize) {
        (islands.of(self.matches[0].from), islands.of(self.matches[0].to))
    }

    /// How many matches agree.
    pub fn agreeing(&self) -> usize {
        self.sets[0].len()
    }

    /// What tells the pair from another one: its matches.
    pub fn key(&self) -> Vec<[PatchId; 2]> {
        let mut key: Vec<_> =
            self.matches.iter().map(|m| [m.from.min(m.to), m.from.max(m.to)]).collect();
        key.sort_unstable();
        key
    }
}

/// The match with the larger island as its target; of equal ones the earlier.
fn larger_first(m: PlaceMatch, islands: &Islands) -> PlaceMatch {
    let size = |patch: PatchId| {
        let island = islands.of(patch);
        (islands.members[island].len(), std::cmp::Reverse(island))
    };
    if size(m.from) >= size(m.to) { m } else { m.reversed() }
}

/// Matches in groups that agree about how high the islands lie to each other, storeys of the same
/// plan in groups of their own. All are one group where no heights are known.
fn by_height(map: &Map, matches: &[PlaceMatch]) -> Vec<Vec<PlaceMatch>> {
    let mut groups: Vec<Vec<PlaceMatch>> = Vec::new();
    for m in matches {
        match groups.iter_mut().find(|group| group[0].link().agrees_in_height(&m.link(), map)) {
            Some(group) => group.push(*m),
            None => groups.push(vec![*m]),
        }
    }
    groups
}

/// An alignment of two islands with what speaks for and against it.
struct Alignment {
    links: Vec<Link>,
    counts: EvidenceCounts,
    /// The chance that it is wrong, as far as it is known by itself; may exceed one.
    bound: f64,
}

/// The best alignment of two islands, doubted as far as another one has evidence too.
fn choose(map: &Map, mut ranked: Vec<Alignment>, most_false: f64) -> Option<Proposal> {
    ranked.sort_by(|a, b| a.bound.total_cmp(&b.bound));
    let rivals = ranked.split_off(1.min(ranked.len()));
    let best = ranked.pop()?;
    let rival = rivals
        .iter()
        .filter(|rival| !say_the_same(map, &best.links, &rival.links, 0.0))
        .map(|rival| best.bound / rival.bound.min(1.0))
        .fold(0.0, f64::max);
    Some(Proposal {
        target_from_source: alignment(map, &best.links)?,
        evidence: best.counts,
        links: best.links,
        false_bound: best.bound.max(rival).min(1.0),
        most_false,
    })
}

/// The rigid motion that brings the source into the target's frame best in the least-squares sense,
/// closed form (Umeyama 1991): of the places the links relate, and of their headings where those
/// say more.
fn alignment(map: &Map, links: &[Link]) -> Option<Pose2> {
    let first = links.first()?;
    let (mut sin, mut cos) = (0.0, 0.0);
    let pairs: Vec<(Vector2<f64>, Vector2<f64>)> = links
        .iter()
        .map(|link| {
            let there = map.pose(link.from) * link.from_from_to.mean;
            let turn = (there.yaw - map.pose(link.to).yaw).sin_cos();
            (sin, cos) = (sin + HEADING_M2 * turn.0, cos + HEADING_M2 * turn.1);
            (there.translation(), map.pose(link.to).translation())
        })
        .collect();
    let n = pairs.len() as f64;
    let mean_there = pairs.iter().map(|p| p.0).sum::<Vector2<f64>>() / n;
    let mean_here = pairs.iter().map(|p| p.1).sum::<Vector2<f64>>() / n;
    for (there, here) in &pairs {
        let (a, b) = (there - mean_there, here - mean_here);
        sin += b.x * a.y - b.y * a.x;
        cos += b.dot(&a);
    }
    let yaw =
        if sin == 0.0 && cos == 0.0 { first.target_from_source(map).yaw } else { sin.atan2(cos) };
    let offset = mean_there - Pose2::new(0.0, 0.0, yaw).rotate(mean_here);
    Some(Pose2::new(offset.x, offset.y, yaw))
}

/// A heading weighs as much as a place that is a metre from the centre.
const HEADING_M2: f64 = 1.0;
