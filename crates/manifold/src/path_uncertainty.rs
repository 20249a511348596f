use crate::{Manifold, PatchId};
use geometry::GaussianPose2;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// A total order on position variances for the heap.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Variance(f64);

impl Eq for Variance {}

impl PartialOrd for Variance {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Variance {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Manifold {
    /// How well patches are known seen from `start`: the Gaussian composed along the path on which
    /// the position's variance grows least (Dijkstra).
    ///
    /// The search ends once all of `wanted` are known; patches not reached by then, and those on
    /// other islands, are `None`.
    pub fn uncertainty_from(
        &self,
        start: PatchId,
        wanted: &[PatchId],
    ) -> Vec<Option<GaussianPose2>> {
        let mut is_wanted = vec![false; self.patches().len()];
        for patch in wanted {
            is_wanted[patch.index()] = true;
        }
        let mut missing = is_wanted.iter().filter(|w| **w).count();
        let mut settled: Vec<Option<GaussianPose2>> = vec![None; self.patches().len()];
        let mut best = vec![f64::INFINITY; self.patches().len()];
        let origin = GaussianPose2::exact(geometry::Pose2::IDENTITY);
        let mut tentative = vec![origin; self.patches().len()];
        let mut queue = BinaryHeap::from([(Reverse(Variance(0.0)), Reverse(start))]);
        best[start.index()] = 0.0;
        while let Some((_, Reverse(patch))) = queue.pop() {
            if settled[patch.index()].is_some() {
                continue;
            }
            let here = tentative[patch.index()];
            settled[patch.index()] = Some(here);
            missing -= usize::from(is_wanted[patch.index()]);
            if missing == 0 {
                break;
            }
            for (other, step) in self.neighbours(patch) {
                if settled[other.index()].is_some() {
                    continue;
                }
                let there = here.compose(&step);
                let variance = there.position_variance_m2();
                if variance < best[other.index()] {
                    best[other.index()] = variance;
                    tentative[other.index()] = there;
                    queue.push((Reverse(Variance(variance)), Reverse(other)));
                }
            }
        }
        settled
    }

    /// [`Manifold::uncertainty_from`] for those patches alone whose position is known to a standard
    /// deviation of `most_std_m` metres (over both axes); it costs what these are, however large
    /// the island is.
    pub fn uncertainty_within(
        &self,
        start: PatchId,
        most_std_m: f64,
    ) -> BTreeMap<PatchId, GaussianPose2> {
        known_within(start, most_std_m, |patch| self.neighbours(patch))
    }
}

/// What is known from `start` to a standard deviation of `most_std_m`, in a graph of relations:
/// composed along the path on which the position's variance grows least.
pub(crate) fn known_within<K: Copy + Ord, N: Iterator<Item = (K, GaussianPose2)>>(
    start: K,
    most_std_m: f64,
    neighbours: impl Fn(K) -> N,
) -> BTreeMap<K, GaussianPose2> {
    let most = most_std_m * most_std_m;
    let origin = GaussianPose2::exact(geometry::Pose2::IDENTITY);
    let mut settled = BTreeMap::new();
    let mut tentative = BTreeMap::from([(start, (0.0, origin))]);
    let mut queue = BinaryHeap::from([(Reverse(Variance(0.0)), Reverse(start))]);
    while let Some((_, Reverse(node))) = queue.pop() {
        // Ways to it that were found before a better one stay in the queue.
        let Some((_, here)) = tentative.remove(&node) else { continue };
        settled.insert(node, here);
        for (other, step) in neighbours(node) {
            if settled.contains_key(&other) {
                continue;
            }
            let there = here.compose(&step);
            let variance = there.position_variance_m2();
            if variance <= most && tentative.get(&other).is_none_or(|(v, _)| variance < *v) {
                tentative.insert(other, (variance, there));
                queue.push((Reverse(Variance(variance)), Reverse(other)));
            }
        }
    }
    settled
}
