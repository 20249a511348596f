use serde::{Deserialize, Serialize};
use std::ops::Add;

/// Why a candidate did not become a closure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rejection {
    /// No pose in the search box scored enough.
    NotFound,
    /// Two distinct poses fit about equally well.
    Ambiguous,
    /// The best pose does not fit well enough after refinement.
    PoorFit,
    /// The match lies too far from what was believed.
    Implausible,
    /// One direction is hardly observed: a corridor.
    Degenerate,
    /// The query saw through walls of the candidate's submap.
    SeenThrough,
    /// No consistent set of closures formed around it.
    Unsupported,
}

/// How many candidates were tried and what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ClosingStatistics {
    /// Candidates verified.
    pub tried: usize,
    /// Closures accepted.
    pub accepted: usize,
    /// Closures retracted after acceptance.
    pub retracted: usize,
    /// Rejections by reason.
    pub not_found: usize,
    /// See [`Rejection::Ambiguous`].
    pub ambiguous: usize,
    /// See [`Rejection::PoorFit`].
    pub poor_fit: usize,
    /// See [`Rejection::SeenThrough`].
    pub seen_through: usize,
    /// See [`Rejection::Implausible`].
    pub implausible: usize,
    /// See [`Rejection::Degenerate`].
    pub degenerate: usize,
    /// See [`Rejection::Unsupported`].
    pub unsupported: usize,
    /// Consistent sets that were not accepted because one of their queries fits elsewhere as well.
    pub rivalled: usize,
}

impl Add for ClosingStatistics {
    type Output = ClosingStatistics;

    fn add(self, other: ClosingStatistics) -> ClosingStatistics {
        ClosingStatistics {
            tried: self.tried + other.tried,
            accepted: self.accepted + other.accepted,
            retracted: self.retracted + other.retracted,
            not_found: self.not_found + other.not_found,
            ambiguous: self.ambiguous + other.ambiguous,
            poor_fit: self.poor_fit + other.poor_fit,
            seen_through: self.seen_through + other.seen_through,
            implausible: self.implausible + other.implausible,
            degenerate: self.degenerate + other.degenerate,
            unsupported: self.unsupported + other.unsupported,
            rivalled: self.rivalled + other.rivalled,
        }
    }
}

impl ClosingStatistics {
    pub(super) fn count(&mut self, rejection: Rejection) {
        *match rejection {
            Rejection::NotFound => &mut self.not_found,
            Rejection::Ambiguous => &mut self.ambiguous,
            Rejection::PoorFit => &mut self.poor_fit,
            Rejection::SeenThrough => &mut self.seen_through,
            Rejection::Implausible => &mut self.implausible,
            Rejection::Degenerate => &mut self.degenerate,
            Rejection::Unsupported => &mut self.unsupported,
        } += 1;
    }
}
