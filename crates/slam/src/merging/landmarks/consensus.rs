use super::alignment::{Islands, Pairing, point_jacobian};
use geometry::{GaussianPose2, Matrix2};
use std::collections::BTreeSet;

/// Pairings that agree about how two islands lie to each other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Consensus {
    /// The pairings, ascending.
    pub members: Vec<Pairing>,
    pub target_from_source: GaussianPose2,
    /// Sum of the members' squared Mahalanobis distances.
    pub chi2: f64,
    /// Size of the largest set that agrees about something else.
    pub rival: usize,
}

/// Three standard deviations: 99.73 % quantiles of chi-squared with one to three degrees of
/// freedom.
pub(crate) const GATE_CHI2: [f64; 3] = [9.0, 11.83, 14.16];
/// Rounds of gathering members and aligning them anew.
const ROUNDS: usize = 8;

/// The largest set of pairings of which each fits the alignment of all; of several as large the one
/// that fits best. Exhaustive: every two pairings that agree in distance, and every one with
/// headings, are taken for right in turn, and all others that fit are gathered. No random choice.
pub(crate) fn consensus(islands: &Islands, pairings: &[Pairing]) -> Option<Consensus> {
    let mut found: Vec<Consensus> = Vec::new();
    let mut explained = BTreeSet::new();
    for (i, &a) in pairings.iter().enumerate() {
        if islands.turn_error(a, &geometry::Pose2::IDENTITY).is_some() {
            found.extend(gather(islands, pairings, vec![a]));
        }
        for &b in &pairings[i + 1..] {
            if !agree_in_distance(islands, a, b) || explained.contains(&(a, b)) {
                continue;
            }
            let Some(set) = gather(islands, pairings, vec![a, b]) else { continue };
            note_pairs(&set.members, &mut explained);
            found.push(set);
        }
    }
    let better = |a: &Consensus, b: &Consensus| {
        let size = b.members.len().cmp(&a.members.len());
        size.then(a.chi2.total_cmp(&b.chi2)).then(a.members.cmp(&b.members))
    };
    found.sort_by(better);
    let mut sets = found.into_iter();
    let mut best = sets.next()?;
    let rival = sets.find(|set| differ(&best, set));
    best.rival = rival.map_or(0, |set| set.members.len());
    Some(best)
}

/// True when two pairings name four landmarks, far enough apart to tell a direction, whose
/// distances on both islands are the same within three standard deviations.
fn agree_in_distance(islands: &Islands, a: Pairing, b: Pairing) -> bool {
    if a.target == b.target || a.source == b.source {
        return false;
    }
    let (target, source, std) = islands.distances(a, b);
    let least = GATE_CHI2[0].sqrt() * std;
    (target - source).abs() <= least && target.min(source) >= least
}

fn note_pairs(members: &[Pairing], explained: &mut BTreeSet<(Pairing, Pairing)>) {
    for (i, &a) in members.iter().enumerate() {
        for &b in &members[i + 1..] {
            explained.insert((a, b));
            explained.insert((b, a));
        }
    }
}

/// The set that grows from a few pairings: members are aligned, those that fit gathered, and so on
/// until nothing changes.
fn gather(islands: &Islands, pairings: &[Pairing], start: Vec<Pairing>) -> Option<Consensus> {
    let least = start.len();
    let mut members = start;
    for _ in 0..ROUNDS {
        let alignment = islands.align(&members)?;
        let from = islands.middle(&members)?;
        let mut fits: Vec<(f64, Pairing)> = pairings
            .iter()
            .filter_map(|&p| {
                let known = members.binary_search(&p).is_ok();
                let chi2 = misfit(islands, p, from, &alignment, known)?;
                Some((chi2, p))
            })
            .collect();
        fits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let next = one_to_one(fits.iter().map(|f| f.1));
        if next.len() < least {
            return None;
        }
        if next == members {
            break;
        }
        members = next;
    }
    settle(islands, members, least)
}

/// Drops the member that fits worst until all fit the alignment of the rest.
fn settle(islands: &Islands, mut members: Vec<Pairing>, least: usize) -> Option<Consensus> {
    while members.len() >= least {
        let target_from_source = islands.align(&members)?;
        let from = islands.middle(&members)?;
        let fits: Vec<Option<f64>> =
            members.iter().map(|&p| misfit(islands, p, from, &target_from_source, true)).collect();
        if fits.iter().all(Option::is_some) {
            let chi2 = fits.iter().flatten().sum();
            return Some(Consensus { members, target_from_source, chi2, rival: 0 });
        }
        let badness =
            |p: Pairing| residual(islands, p, from, &target_from_source, true).map_or(0.0, |r| r.0);
        let worst = (0..members.len())
            .max_by(|&i, &j| badness(members[i]).total_cmp(&badness(members[j])))?;
        members.remove(worst);
    }
    None
}

/// Squared Mahalanobis distance of a pairing's residual if it is within three standard deviations.
pub(crate) fn misfit(
    islands: &Islands,
    p: Pairing,
    from: Pairing,
    alignment: &GaussianPose2,
    member: bool,
) -> Option<f64> {
    let (chi2, gate) = residual(islands, p, from, alignment, member)?;
    (chi2 <= gate).then_some(chi2)
}

/// Squared Mahalanobis distance of a pairing's residual, and what it may be.
fn residual(
    islands: &Islands,
    p: Pairing,
    from: Pairing,
    alignment: &GaussianPose2,
    member: bool,
) -> Option<(f64, f64)> {
    let pose = &alignment.mean;
    let (t, s) = islands.positions(p);
    let spread = spread(islands, p, from, alignment, member);
    let error = pose.transform(s) - t;
    let chi2 = error.dot(&(spread.try_inverse()? * error));
    Some(match islands.turn_error(p, pose) {
        Some((turn, variance)) => (chi2 + turn * turn / variance, GATE_CHI2[2]),
        None => (chi2, GATE_CHI2[1]),
    })
}

/// Covariance of a pairing's residual. The alignment's own uncertainty counts for those that it was
/// not made of.
pub(crate) fn spread(
    islands: &Islands,
    p: Pairing,
    from: Pairing,
    alignment: &GaussianPose2,
    member: bool,
) -> Matrix2<f64> {
    let pose = &alignment.mean;
    let spread = islands.spread(p, from, pose.yaw);
    if member {
        return spread;
    }
    let jacobian = point_jacobian(pose, &islands.positions(p).1);
    spread + jacobian * alignment.covariance * jacobian.transpose()
}

/// The pairings in this order whose landmarks no earlier one has taken; ascending.
fn one_to_one(pairings: impl Iterator<Item = Pairing>) -> Vec<Pairing> {
    let (mut targets, mut sources) = (BTreeSet::new(), BTreeSet::new());
    let mut chosen = Vec::new();
    for p in pairings {
        if !targets.contains(&p.target) && !sources.contains(&p.source) {
            targets.insert(p.target);
            sources.insert(p.source);
            chosen.push(p);
        }
    }
    chosen.sort_unstable();
    chosen
}

/// True when two sets say different things, more than their uncertainties allow.
fn differ(a: &Consensus, b: &Consensus) -> bool {
    let (a, b) = (&a.target_from_source, &b.target_from_source);
    let sum = GaussianPose2 { mean: a.mean, covariance: a.covariance + b.covariance };
    sum.mahalanobis_squared(&b.mean).is_none_or(|chi2| chi2 > GATE_CHI2[2])
}
