use super::common_ground::{CommonGround, Seen};
use super::estimate::{MOST_SQUARES, Observed, Usual, beyond_a_copy, decades, may_suffice};
use super::evidence::{Evidence, examine};
use super::places::PlaceIndex;
use super::recognition::{PlaceMatch, recognise};
use super::sets::agreeing_sets;
use super::usual::usual;
use super::{EvidenceCounts, Link, Proposal};
use crate::SlamConfig;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use geometry::{Pose2, Vector2};
use manifold::{Islands, PatchId, Provenance};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Cells of the grid that patches are looked up in, metres.
const GRID_M: f64 = 4.0;
/// Two alignments of the same islands nearer than this at their links are the same one, metres and
/// radians: islands are bent.
const SAME_M: f64 = 1.5;
const SAME_RAD: f64 = 0.15;

/// Place recognition between islands: matches are found once, and grouped anew as islands join.
pub(super) struct GeometricMerging {
    index: PlaceIndex,
    matches: Vec<PlaceMatch>,
    /// Comparisons made.
    pub tried: usize,
    usual: Usual,
}

impl GeometricMerging {
    /// Compares the places of all islands.
    pub fn new(map: &Map, config: &SlamConfig) -> Self {
        let islands = map.manifold.component_map();
        let spacing_m = config.merging.spacing_m;
        let index = PlaceIndex::new(map, &islands, &config.submap, spacing_m);
        let (matches, tried) = recognise(map, &index, config);
        let usual = usual(map, &islands, &PatchGrid::new(map, &islands, GRID_M), config);
        GeometricMerging { index, matches, tried, usual }
    }

    /// How the islands may lie to each other, for every pair that has matches.
    pub fn propose(&self, map: &Map, islands: &Islands, config: &SlamConfig) -> Vec<Proposal> {
        let grid = PatchGrid::new(map, islands, GRID_M);
        let mut places: Vec<Vec<PatchId>> = vec![Vec::new(); islands.members.len()];
        for place in &self.index.places {
            places[islands.of(place.patch)].push(place.patch);
        }
        let mut pairs: BTreeMap<(usize, usize), Vec<PlaceMatch>> = BTreeMap::new();
        for m in &self.matches {
            let m = larger_first(*m, islands);
            let (target, source) = (islands.of(m.from), islands.of(m.to));
            if target != source {
                pairs.entry((target, source)).or_default().push(m);
            }
        }
        let pairs: Vec<((usize, usize), Vec<PlaceMatch>)> = pairs.into_iter().collect();
        let best = |((_, source), matches): &((usize, usize), Vec<PlaceMatch>)| {
            let examined: Vec<(usize, Evidence)> =
                agreeing_sets(map, matches, config.merging.least_agreeing)
                    .iter()
                    .map(|set| {
                        (set.len(), examine(map, islands, set, &places[*source], &grid, config))
                    })
                    .collect();
            choose(map, self.weighed(map, islands, &grid, examined))
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
                let ground = CommonGround::of(map, grid, &islands.of, &evidence.seen, everything);
                let squares = &ground.squares[..ground.squares.len().min(MOST_SQUARES)];
                observed.compared_m = ground.compared_m;
                observed.contradicted_m = ground.contradicted_m;
                observed.squares = squares.len();
                observed.beyond = beyond_a_copy(squares);
            }
            let counts = counted(matches, &evidence, &observed);
            let bound = 10f64.powf(decades(&observed, &self.usual));
            Alignment { links: evidence.links, counts, bound }
        };
        examined.into_iter().map(weigh).collect()
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
        contradicted_cm: (100.0 * observed.contradicted_m).round() as u32,
        squares: observed.squares,
        beyond: observed.beyond,
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

/// An alignment of two islands with what speaks for and against it.
struct Alignment {
    links: Vec<PlaceMatch>,
    counts: EvidenceCounts,
    /// The chance that it is wrong, as far as it is known by itself; may exceed one.
    bound: f64,
}

/// The best alignment of two islands, doubted as far as another one has evidence too.
fn choose(map: &Map, mut ranked: Vec<Alignment>) -> Option<Proposal> {
    ranked.sort_by(|a, b| a.bound.total_cmp(&b.bound));
    let rivals = ranked.split_off(1.min(ranked.len()));
    let best = ranked.pop()?;
    let rival = rivals
        .iter()
        .filter(|rival| !is_same(map, &best.links, &rival.links))
        .map(|rival| best.bound / rival.bound.min(1.0))
        .fold(0.0, f64::max);
    let link = |m: &PlaceMatch| Link {
        from: m.from,
        to: m.to,
        from_from_to: m.from_from_to,
        provenance: Provenance::Merge,
    };
    Some(Proposal {
        target_from_source: alignment(map, &best.links)?,
        evidence: best.counts,
        links: best.links.iter().map(link).collect(),
        false_bound: best.bound.max(rival).min(1.0),
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
        apart.norm() < SAME_M && apart.yaw.abs() < SAME_RAD
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
