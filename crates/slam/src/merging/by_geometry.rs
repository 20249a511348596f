use super::evidence::{Evidence, examine};
use super::places::PlaceIndex;
use super::recognition::{PlaceMatch, Recognition};
use super::sets::agreeing_sets;
use super::{EvidenceCounts, Link, Proposal};
use crate::SlamConfig;
use crate::loop_closing::Verifier;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{Pose2, Vector2};
use manifold::{Islands, PatchId, Provenance};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How much less likely every further independent place that fits makes a wrong merge: buildings
/// repeat themselves, so that a wrong one that fits at one place often fits at the next as well.
/// Measured on twin buildings (see docs/math/merging.md).
const FALSE_FIT: f64 = 0.1;
/// How much more likely every contradicting place makes it: people and doors move, so that a right
/// merge has some too.
const CONTRADICTED: f64 = 25.0;
/// Share of sight lines that pass through walls where a robot comes back to the same place, by
/// people and doors that moved: what is taken before anything is measured, and for how many
/// closures that counts.
const USUALLY_THROUGH: f64 = 0.015;
const USUAL_CLOSURES: f64 = 4.0;
/// Closures that are looked at to find out.
const MOST_CLOSURES: usize = 60;
/// The share may exceed the usual by so much for nothing; every so much beyond makes a wrong merge
/// ten times as likely. Wrong merges of look-alike places had 0.04 in all and more wherever five
/// places fitted, right ones in the same worlds 0.02 at most.
const MARGIN_THROUGH: f64 = 0.008;
const THROUGH_PER_DECADE: f64 = 0.004;
/// Cells of the grid that patches are looked up in, metres.
const GRID_M: f64 = 4.0;
/// Two alignments of the same islands nearer than this at their links are the same one, metres and
/// radians: islands are bent.
const SAME_M: f64 = 1.5;
const SAME_RAD: f64 = 0.15;

/// Place recognition between islands: matches are found once, and grouped anew as islands join.
pub(super) struct GeometricMerging {
    index: PlaceIndex,
    recognition: Recognition,
    matches: Vec<PlaceMatch>,
    /// See [`USUALLY_THROUGH`].
    usually_through: f64,
}

impl GeometricMerging {
    /// Finds places on all islands; none is compared yet.
    pub fn new(map: &Map, config: &SlamConfig) -> Self {
        let islands = map.manifold.component_map();
        let spacing_m = config.merging.spacing_m;
        let index = PlaceIndex::new(map, &islands, &config.submap, spacing_m);
        let recognition = Recognition::new(map, &index, &config.merging);
        let usually_through = usually_through(map, config);
        GeometricMerging { index, recognition, matches: Vec::new(), usually_through }
    }

    /// Compares more places of islands that are still apart; false when all were compared.
    pub fn look(&mut self, map: &Map, islands: &Islands, config: &SlamConfig) -> bool {
        let found = self.recognition.next_pass(map, islands, config);
        self.matches.extend(found.iter().flatten());
        found.is_some()
    }

    /// Comparisons made.
    pub fn tried(&self) -> usize {
        self.recognition.tried
    }

    /// Pairs of islands whose matches agree, of which one at least is new.
    pub fn pairs(
        &self,
        map: &Map,
        islands: &Islands,
        is_new: impl Fn(usize) -> bool,
        config: &SlamConfig,
    ) -> Vec<IslandPair> {
        let mut pairs: BTreeMap<(usize, usize), Vec<PlaceMatch>> = BTreeMap::new();
        for m in &self.matches {
            let m = larger_first(*m, islands);
            let (target, source) = (islands.of(m.from), islands.of(m.to));
            if target != source && (is_new(target) || is_new(source)) {
                pairs.entry((target, source)).or_default().push(m);
            }
        }
        let pairs: Vec<Vec<PlaceMatch>> = pairs.into_values().collect();
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
            choose(map, examined, self.usually_through, config.merging.false_merges)
        };
        pairs.par_iter().filter_map(best).collect()
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

/// How much robots see through walls of their own maps where they come back: the mean over their
/// closures.
fn usually_through(map: &Map, config: &SlamConfig) -> f64 {
    let closures = map.manifold.active_relations();
    let closures: Vec<_> =
        closures.filter(|r| r.provenance == Provenance::LoopClosure).copied().collect();
    let step = closures.len().div_ceil(MOST_CLOSURES).max(1);
    let looked_at: Vec<_> = closures.into_iter().step_by(step).collect();
    let verifier = Verifier::new(&config.for_merging());
    let through: Vec<f64> = looked_at
        .par_iter()
        .map_init(
            || verifier.clone(),
            |verifier, r| verifier.contradiction(r.to, r.from, &r.from_from_to.mean, map).max(0.0),
        )
        .collect();
    (USUAL_CLOSURES * USUALLY_THROUGH + through.iter().sum::<f64>())
        / (USUAL_CLOSURES + through.len() as f64)
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
        match groups.iter_mut().find(|group| group[0].agrees_in_height(m, map)) {
            Some(group) => group.push(*m),
            None => groups.push(vec![*m]),
        }
    }
    groups
}

/// The best alignment of two islands, doubted as far as another one has evidence too.
fn choose(
    map: &Map,
    examined: Vec<(usize, Evidence)>,
    usually_through: f64,
    most_false: f64,
) -> Option<Proposal> {
    let bound = |e: &Evidence| -> f64 {
        let beyond = (e.seen_through - usually_through - MARGIN_THROUGH).max(0.0);
        FALSE_FIT.powi(e.agreeing as i32 - 1)
            * CONTRADICTED.powi(e.contradicting as i32)
            * 10f64.powf(beyond / THROUGH_PER_DECADE)
    };
    let mut ranked: Vec<(f64, usize, Evidence)> =
        examined.into_iter().map(|(matches, e)| (bound(&e), matches, e)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rivals = ranked.split_off(1.min(ranked.len()));
    let (own_bound, matches, evidence) = ranked.pop()?;
    let rival = rivals
        .iter()
        .filter(|(_, _, rival)| !is_same(map, &evidence.links, &rival.links))
        .map(|(bound, _, _)| own_bound / bound.min(1.0))
        .fold(0.0, f64::max);
    let link = |m: &PlaceMatch| Link {
        from: m.from,
        to: m.to,
        from_from_to: m.from_from_to,
        provenance: Provenance::Merge,
    };
    Some(Proposal {
        target_from_source: alignment(map, &evidence.links)?,
        evidence: EvidenceCounts {
            matches,
            agreeing: evidence.agreeing,
            contradicting: evidence.contradicting,
            places: evidence.places,
            fitting: evidence.fitting,
            seen_through_per_mille: (1000.0 * evidence.seen_through).round() as u32,
        },
        links: evidence.links.iter().map(link).collect(),
        false_bound: own_bound.max(rival).min(1.0),
        most_false,
    })
}

/// True when two sets of links say the same: most of the second lie where the nearest of the first
/// has them.
fn is_same(map: &Map, links: &[PlaceMatch], others: &[PlaceMatch]) -> bool {
    let agrees = |other: &&PlaceMatch| {
        let place = map.pose(other.to);
        let distance = |link: &&PlaceMatch| map.pose(link.to).distance(&place);
        let Some(link) = links.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
            return false;
        };
        let here = link.target_from_source(map) * place;
        let apart = here.between(&(other.target_from_source(map) * place));
        apart.norm() < SAME_M && apart.yaw.abs() < SAME_RAD && link.agrees_in_height(other, map)
    };
    2 * others.iter().filter(agrees).count() > others.len()
}

/// The rigid motion that brings the source into the target's frame best in the least-squares sense,
/// closed form (Umeyama 1991): of the places the links relate, and of their headings where those
/// say more.
fn alignment(map: &Map, links: &[PlaceMatch]) -> Option<Pose2> {
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
