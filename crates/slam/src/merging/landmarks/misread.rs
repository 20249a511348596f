//! Landmarks that two islands know by different ids at the same place: one of the ids was read
//! wrong.

use super::alignment::{Islands, Pairing};
use super::consensus::{Consensus, GATE_CHI2, spread};
use std::f64::consts::PI;

/// All pairs of landmarks of a kind whose ids differ and that no member of a set has taken.
pub(super) fn misread_pairings(islands: &Islands, set: &Consensus) -> Vec<Pairing> {
    let mut pairings = Vec::new();
    for (target, t) in islands.target.landmarks.iter().enumerate() {
        for (source, s) in islands.source.landmarks.iter().enumerate() {
            let is_free = set.members.iter().all(|m| m.target != target && m.source != source);
            let differ = t.id.is_some() && s.id.is_some() && t.id != s.id;
            if is_free && differ && t.kind == s.kind {
                pairings.push(Pairing { target, source });
            }
        }
    }
    pairings
}

/// An alignment must become ten times as sure by a pair, as by a match of scans; else the pair may
/// as well be there by accident.
const MOST_LIKELY: f64 = 0.1;

/// How much less likely a wrong alignment becomes by every one of some pairings that covers each
/// other. If it is right, an id is read wrong with the chance `wrong`; if it is not, landmarks are
/// there by accident: so many among all pairings. `None` where that says too little.
pub(super) fn by_accident(
    islands: &Islands,
    set: &Consensus,
    pairings: &[Pairing],
    wrong: f64,
) -> Option<f64> {
    let from = islands.middle(&set.members)?;
    let area = |p: &Pairing| {
        let spread = spread(islands, *p, from, &set.target_from_source, false);
        PI * GATE_CHI2[1] * spread.determinant().max(0.0).sqrt() / islands.target.area_m2
    };
    let ratio = pairings.iter().map(area).sum::<f64>() / wrong;
    (ratio <= MOST_LIKELY).then_some(ratio)
}
