use super::Closure;
use crate::map::Map;
use manifold::PatchId;

/// Closures that wait for others to agree with them.
///
/// Two closures agree when driving from one to the other along the robot's recent path gives the
/// same as driving along the old one: the pairwise consistency of PCM (Mangelson et al., ICRA
/// 2018), with a tolerance in place of covariances that grows with the distance between the two.
pub(crate) struct PendingClosures {
    support: usize,
    waiting: Vec<Closure>,
}

/// A closure within its uncertainty that moves the robot less than this needs no witnesses: the map
/// already agrees with it.
const SMALL_SHIFT_M: f64 = 0.5;
/// 99 % quantile of chi-squared with three degrees of freedom.
const CHI2_3_99: f64 = 11.34;
/// Disagreement allowed between two closures next to each other, and its growth with their
/// distance.
const TOLERANCE_M: f64 = 0.15;
const TOLERANCE_PER_M: f64 = 0.02;
const TOLERANCE_RAD: f64 = 0.04;

impl PendingClosures {
    pub fn new(support: usize) -> Self {
        PendingClosures { support, waiting: Vec::new() }
    }

    /// Takes a verified closure and returns those that may now be accepted: the largest set found
    /// of closures that all agree with one another and with the new one, if it has enough members.
    /// They wait on until [`PendingClosures::accept`].
    pub fn offer(&mut self, closure: Closure, map: &Map) -> Vec<Closure> {
        if closure.surprise < CHI2_3_99 && closure.shift.norm() < SMALL_SHIFT_M {
            return vec![closure];
        }
        let mut set = vec![closure];
        let mut witnesses = 0;
        for other in self.waiting.iter().rev() {
            if set.iter().all(|member| agree(member, other, map)) {
                // A second closure of the same query is no new evidence.
                witnesses += usize::from(set.iter().all(|member| member.to != other.to));
                set.push(*other);
            }
        }
        self.waiting.push(closure);
        if witnesses < self.support { Vec::new() } else { set }
    }

    /// The closures of an accepted set wait no longer.
    pub fn accept(&mut self, set: &[Closure]) {
        self.waiting.retain(|w| !set.contains(w));
    }

    /// Drops closures whose query is more than `age` patches older than `now`; returns how many.
    pub fn expire(&mut self, now: PatchId, age: u32) -> usize {
        let before = self.waiting.len();
        self.waiting.retain(|w| w.to.0.saturating_add(age) >= now.0);
        before - self.waiting.len()
    }
}

/// True when two closures fit together: around the loop `a.to -> a.from -> b.from -> b.to -> a.to`
/// nothing is left over.
fn agree(a: &Closure, b: &Closure, map: &Map) -> bool {
    let driven = map.pose(a.to).between(&map.pose(b.to));
    let old_way = map.pose(a.from).between(&map.pose(b.from));
    let around = a.result.pose.inverse() * old_way * b.result.pose;
    let left = driven.between(&around);
    left.norm() < TOLERANCE_M + TOLERANCE_PER_M * driven.norm() && left.yaw.abs() < TOLERANCE_RAD
}
