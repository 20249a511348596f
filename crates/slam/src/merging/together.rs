use super::{Proposal, say_the_same};
use crate::map::Map;
use geometry::GaussianPose2;
use manifold::Islands;

/// Links of places and of landmarks lie apart: what both islands may be bent between them, see
/// `sets`.
const BENT_PER_M: f64 = 0.04;

/// Proposals by geometry and by landmarks, one for each two islands where they agree.
///
/// What walls say and what landmarks say is independent: where both have it alike, both chances of
/// being wrong must come true. Where they contradict each other, each is doubted as far as the
/// other has evidence.
pub(super) fn together(
    map: &Map,
    islands: &Islands,
    geometry: Vec<Proposal>,
    landmarks: Vec<Proposal>,
) -> Vec<Proposal> {
    let mut all = geometry;
    for mut by_landmarks in landmarks {
        let Some(ends) = by_landmarks.ends(islands) else { continue };
        let reversed = (ends.1, ends.0);
        let same_pair =
            |p: &Proposal| p.ends(islands).is_some_and(|found| found == ends || found == reversed);
        let Some(at) = all.iter().position(same_pair) else {
            all.push(by_landmarks);
            continue;
        };
        if all[at].ends(islands) != Some(ends) {
            by_landmarks = by_landmarks.reversed();
        }
        if say_the_same(map, &all[at].links, &by_landmarks.links, BENT_PER_M) {
            all[at].support(by_landmarks);
        } else {
            let (one, other) = (all[at].false_bound, by_landmarks.false_bound);
            all[at].false_bound = doubted(one, other);
            by_landmarks.false_bound = doubted(other, one);
            all.push(by_landmarks);
        }
    }
    all
}

/// The chance of being wrong of something that is contradicted by something else, at most one of
/// which is right.
fn doubted(own: f64, rival: f64) -> f64 {
    if rival >= 1.0 { own } else { (own / rival.max(f64::MIN_POSITIVE)).clamp(own, 1.0) }
}

impl Proposal {
    /// The same with the islands' roles exchanged.
    fn reversed(mut self) -> Self {
        self.target_from_source = self.target_from_source.inverse();
        for link in &mut self.links {
            std::mem::swap(&mut link.from, &mut link.to);
            link.from_from_to = GaussianPose2::inverse(&link.from_from_to);
        }
        self
    }

    /// Adds what else says the same.
    fn support(&mut self, other: Proposal) {
        // The alignment stays that of the surer.
        if other.false_bound < self.false_bound {
            self.target_from_source = other.target_from_source;
        }
        self.false_bound *= other.false_bound;
        self.most_false = self.most_false.max(other.most_false);
        self.evidence = self.evidence + other.evidence;
        self.links.extend(other.links);
    }
}
