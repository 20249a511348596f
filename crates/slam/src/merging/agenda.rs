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
    /// What was examined, by its matches.
    examined: BTreeSet<Vec<[PatchId; 2]>>,
    /// First patches of islands that do not hold together.
    refused: BTreeSet<[PatchId; 2]>,
}

impl Agenda {
    /// Adds pairs in place of others of the same islands, and forgets those that have become one.
    pub fn replace(&mut self, pairs: Vec<IslandPair>, islands: &Islands) {
        let of = |pair: &IslandPair| firsts(pair.ends(islands), islands);
        let new: BTreeSet<_> = pairs.iter().map(of).collect();
        self.open.retain(|pair| {
            let ends = of(pair);
            ends[0] != ends[1] && !new.contains(&ends)
        });
        self.open.extend(pairs);
    }

    /// Leaves out a pair of islands from now on.
    pub fn refuse(&mut self, pair: (usize, usize), islands: &Islands) {
        self.refused.insert(firsts(pair, islands));
    }

    /// True for a pair that is left out.
    pub fn is_refused(&self, pair: (usize, usize), islands: &Islands) -> bool {
        self.refused.contains(&firsts(pair, islands))
    }

    /// The pairs to be examined now: no island is in two of them. Those of which an island has
    /// grown without any new match come last, and only if `again`.
    pub fn next(&mut self, islands: &Islands, again: bool) -> Vec<IslandPair> {
        let refused = &self.refused;
        self.open.retain(|pair| !refused.contains(&firsts(pair.ends(islands), islands)));
        let weight = |pair: &IslandPair| {
            let is_new = !self.examined.contains(&pair.key());
            (is_new, pair.agreeing(), Reverse(pair.ends(islands)))
        };
        let weights: Vec<_> = self.open.iter().map(weight).collect();
        if !again && !weights.iter().any(|w| w.0) {
            return Vec::new();
        }
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
                (again || w.0) && heaviest[&a] == *w && heaviest[&b] == *w
            })
        };
        let due: Vec<IslandPair> = self.open.extract_if(.., is_due).collect();
        self.examined.extend(due.iter().map(IslandPair::key));
        due
    }
}

/// The first patches of two islands, in order.
fn firsts((a, b): (usize, usize), islands: &Islands) -> [PatchId; 2] {
    let [a, b] = [a, b].map(|island| islands.members[island][0]);
    [a.min(b), a.max(b)]
}
