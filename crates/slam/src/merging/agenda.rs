use super::by_geometry::IslandPair;
use manifold::{Islands, PatchId};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Pairs of islands that are to be examined.
///
/// Examining is what merging takes its time for. So in every round those pairs are examined that
/// have more agreeing matches than any other pair of their two islands, the locally heaviest edges
/// of the graph of islands (Preis 1999): where they join, the pairs within the new island need not
/// be looked at any more.
#[derive(Default)]
pub(super) struct Agenda {
    open: Vec<IslandPair>,
    /// What was examined, by its matches. A pair of which an island has grown without any new match
    /// is examined last.
    examined: BTreeSet<Vec<[PatchId; 2]>>,
    /// First patches of islands that do not hold together.
    refused: BTreeSet<[PatchId; 2]>,
}

impl Agenda {
    /// Adds pairs.
    pub fn add(&mut self, pairs: Vec<IslandPair>) {
        self.open.extend(pairs);
    }

    /// Takes pairs off that are out of date.
    pub fn forget(&mut self, is_old: impl Fn(&IslandPair) -> bool) {
        self.open.retain(|pair| !is_old(pair));
    }

    /// Pairs of islands, by their first patches, that need not be examined any more.
    pub fn refuse(&mut self, pairs: impl Iterator<Item = [PatchId; 2]>) {
        self.refused.extend(pairs);
    }

    /// True for a pair that need not be examined any more.
    pub fn is_refused(&self, ends: Option<(usize, usize)>, islands: &Islands) -> bool {
        ends.is_none_or(|ends| self.refused.contains(&firsts(ends, islands)))
    }

    /// The pairs to be examined now: no island is in two of them.
    pub fn next(&mut self, islands: &Islands) -> Vec<IslandPair> {
        let refused = &self.refused;
        self.open.retain(|pair| !refused.contains(&firsts(pair.ends(islands), islands)));
        let weight = |pair: &IslandPair| {
            let is_new = !self.examined.contains(&pair.key());
            (is_new, pair.agreeing(), Reverse(pair.ends(islands)))
        };
        let weights: Vec<_> = self.open.iter().map(weight).collect();
        let mut heaviest = BTreeMap::new();
        for w in &weights {
            let Reverse((a, b)) = w.2;
            for end in [a, b] {
                let best = heaviest.entry(end).or_insert(*w);
                *best = (*best).max(*w);
            }
        }
        let mut weights = weights.iter();
        let is_due = |_: &mut IslandPair| {
            weights.next().is_some_and(|w| {
                let Reverse((a, b)) = w.2;
                heaviest[&a] == *w && heaviest[&b] == *w
            })
        };
        let due: Vec<IslandPair> = self.open.extract_if(.., is_due).collect();
        self.examined.extend(due.iter().map(IslandPair::key));
        due
    }
}

/// The first patches of two islands, in order.
pub(super) fn firsts((a, b): (usize, usize), islands: &Islands) -> [PatchId; 2] {
    let [a, b] = [a, b].map(|island| islands.members[island][0]);
    [a.min(b), a.max(b)]
}
