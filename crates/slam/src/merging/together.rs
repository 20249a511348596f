use super::{Link, Proposal};
use crate::map::Map;
use geometry::{GaussianPose2, Pose2};
use manifold::Islands;

/// Two links nearer than this to each other say the same, metres and radians ...
const SAME_M: f64 = 1.5;
const SAME_RAD: f64 = 0.15;
/// ... and more with the distance between them: what both islands may be bent, see `sets`.
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
        if is_same(map, &all[at], &by_landmarks) {
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

/// True when two proposals for the same islands say the same: most links of the second lie where
/// the nearest of the first has them.
fn is_same(map: &Map, one: &Proposal, other: &Proposal) -> bool {
    let agrees = |link: &&Link| {
        let place = map.pose(link.to);
        let distance = |near: &&Link| map.pose(near.to).distance(&place);
        let nearest = one.links.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.is_some_and(|near| {
            let [here, there] = [near, *link].map(|l| target_from_source(map, l) * place);
            let apart = here.between(&there);
            let bent = BENT_PER_M * distance(&near);
            apart.norm() < SAME_M + bent && apart.yaw.abs() < SAME_RAD
        })
    };
    2 * other.links.iter().filter(agrees).count() > other.links.len()
}

/// How the islands lie to each other by one link.
fn target_from_source(map: &Map, link: &Link) -> Pose2 {
    map.pose(link.from) * link.from_from_to.mean * map.pose(link.to).inverse()
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
