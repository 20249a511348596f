//! The chance that landmarks agree by accident (docs/math/landmarks.md).

use super::alignment::{Islands, Pairing};
use super::consensus::{Consensus, GATE_CHI2, misfit};
use std::f64::consts::PI;

/// Chance that no id common to two islands names the same thing on both: another building, another
/// numbering. Robots of one team are seldom told of two buildings.
const UNRELATED: f64 = 0.01;

/// What is compared by id: how many ids both islands know, and the chance that one misleads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shared {
    pub ids: usize,
    /// Share of ids that do not mean the same thing on both islands.
    pub wrong: f64,
    /// See [`UNRELATED`]; none where the robots met.
    pub unrelated: f64,
}

impl Shared {
    pub fn tags(ids: usize, wrong: f64) -> Self {
        Shared { ids, wrong, unrelated: UNRELATED }
    }

    /// Bound on the chance that a consensus by ids is wrong: the expected number of such sets by
    /// accident where fewer ids are right than it has members, over the chance that so many are.
    pub fn false_bound(&self, islands: &Islands, set: &Consensus, pairings: &[Pairing]) -> f64 {
        let k = set.members.len();
        let n = self.ids.max(k);
        let right = |r: usize| {
            let r_right = (1.0 - self.wrong).powi(r as i32);
            binomial(n, r) * r_right * self.wrong.powi((n - r) as i32)
        };
        let fewer: f64 = (0..k).map(right).sum();
        let unrelated = self.unrelated / (1.0 - self.unrelated);
        let odds = (unrelated + fewer) / right(k).max(f64::MIN_POSITIVE);
        let chosen = binomial(n, k) * places(set, pairings);
        let accident = odds * chosen * accident(islands, &set.members);
        (accident + self.exchanged(islands, k)).min(1.0)
    }

    /// Odds that two ids were read as each other's: they lie at the right distance, half a turn
    /// off, and nothing is by accident. With more members an exchange shows.
    fn exchanged(&self, islands: &Islands, members: usize) -> f64 {
        if members != 2 {
            return 0.0;
        }
        let others = islands.target.landmarks.len().saturating_sub(1).max(1);
        (self.wrong / (1.0 - self.wrong)).powi(2) / others as f64
    }
}

/// Bound on the chance that a pattern of landmarks without ids agrees by accident: the expected
/// number of sets so large among all ways to pair them.
pub(super) fn pattern_bound(islands: &Islands, set: &Consensus) -> f64 {
    let k = set.members.len();
    let of = |count: usize| binomial(count, k);
    let orders: f64 = (1..=k).map(|i| i as f64).product();
    let (targets, sources) = (islands.target.landmarks.len(), islands.source.landmarks.len());
    (of(targets) * of(sources) * orders * accident(islands, &set.members)).min(1.0)
}

/// In how many ways the members' ids could have been paired where they occur at several places.
fn places(set: &Consensus, pairings: &[Pairing]) -> f64 {
    let ways = |p: &Pairing| {
        let alike = |q: &&Pairing| q.target == p.target || q.source == p.source;
        pairings.iter().filter(alike).count() as f64
    };
    set.members.iter().map(ways).product()
}

/// Chance that pairings agree whose landmarks have nothing to do with each other: the second must
/// lie at its distance from the first, each further one where these two say.
pub(super) fn accident(islands: &Islands, members: &[Pairing]) -> f64 {
    let Some((a, b)) = farthest(islands, members) else { return 1.0 };
    let mut chance = ring(islands, a, b);
    let Some(alignment) = islands.align(&[a, b]) else { return 1.0 };
    for &p in members.iter().filter(|p| **p != a && **p != b) {
        let spread = islands.spread(p, a, alignment.mean.yaw).determinant().max(0.0).sqrt();
        let area = PI * GATE_CHI2[1] * spread / islands.target.area_m2;
        let hit = |i: usize| misfit(islands, Pairing { target: i, ..p }, a, &alignment, true);
        chance *= area.max(share(islands, &[a, b, p], |i| hit(i).is_some())).min(1.0);
    }
    chance
}

/// Chance that a landmark lies at the distance that `b` has from `a`.
fn ring(islands: &Islands, a: Pairing, b: Pairing) -> f64 {
    let (_, distance, std) = islands.distances(a, b);
    let half = GATE_CHI2[0].sqrt() * std;
    let area = 2.0 * PI * distance * 2.0 * half / islands.target.area_m2;
    let hit = |i: usize| {
        let (found, _, _) = islands.distances(a, Pairing { target: i, ..b });
        (found - distance).abs() <= half
    };
    area.max(share(islands, &[a, b], hit)).min(1.0)
}

/// Share of the target's other landmarks that would have fitted as well: they need not lie evenly,
/// and an id read wrong is that of another landmark.
fn share(islands: &Islands, taken: &[Pairing], hit: impl Fn(usize) -> bool) -> f64 {
    let count = islands.target.landmarks.len();
    let others = (0..count).filter(|i| taken.iter().all(|p| p.target != *i));
    let (mut all, mut hits) = (0usize, 0usize);
    for i in others {
        all += 1;
        hits += usize::from(hit(i));
    }
    hits as f64 / all.max(1) as f64
}

/// The two members farthest apart on the target.
fn farthest(islands: &Islands, members: &[Pairing]) -> Option<(Pairing, Pairing)> {
    let mut best: Option<(f64, Pairing, Pairing)> = None;
    for (i, &a) in members.iter().enumerate() {
        for &b in &members[i + 1..] {
            let distance = (islands.positions(a).0 - islands.positions(b).0).norm();
            if best.is_none_or(|(longest, _, _)| distance > longest) {
                best = Some((distance, a, b));
            }
        }
    }
    best.map(|(_, a, b)| (a, b))
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).map(|i| (n - i) as f64 / (k - i) as f64).product()
}

#[cfg(test)]
mod tests {
    use super::binomial;

    #[test]
    fn binomials_are_those_of_pascal() {
        for n in 0..20 {
            assert_eq!(binomial(n, 0), 1.0);
            for k in 1..=n {
                let below = binomial(n - 1, k - 1) + if k < n { binomial(n - 1, k) } else { 0.0 };
                if n > 0 {
                    assert!((binomial(n, k) - below).abs() < 1e-9 * below);
                }
            }
        }
    }
}
