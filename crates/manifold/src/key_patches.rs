use crate::path_uncertainty::known_within;
use crate::{Manifold, PatchId};
use geometry::GaussianPose2;
use std::collections::BTreeMap;

/// A part of the patches, so chosen that every patch is known well from one of them, and how well
/// they are known from one another.
///
/// What is known of far patches is looked up along the key patches instead of along all: a search
/// over a large island costs as much as it has key patches.
#[derive(Clone, Debug, Default)]
pub struct KeyPatches {
    keys: Vec<Key>,
    /// For every patch its key's index and `key_from_patch`.
    of: Vec<Option<(usize, GaussianPose2)>>,
}

#[derive(Clone, Debug)]
struct Key {
    patch: PatchId,
    members: Vec<PatchId>,
    neighbours: BTreeMap<usize, GaussianPose2>,
}

/// Key patches known to so many times the standard deviation of their members are neighbours: those
/// next to each other and those behind, so that a path by way of them goes hardly astray.
const NEIGHBOUR_STDS: f64 = 2.5;

impl KeyPatches {
    /// Key patches of a manifold, such that every patch's position is known from one of them to a
    /// standard deviation of `std_m` metres (over both axes).
    pub fn new(manifold: &Manifold, std_m: f64) -> Self {
        let mut covered = vec![false; manifold.patches().len()];
        let mut keys: Vec<Key> = Vec::new();
        for patch in manifold.patches().iter().map(|p| p.id) {
            if !covered[patch.index()] {
                for member in manifold.uncertainty_within(patch, std_m).keys() {
                    covered[member.index()] = true;
                }
                keys.push(Key { patch, members: Vec::new(), neighbours: BTreeMap::new() });
            }
        }
        let mut all = KeyPatches { keys, of: vec![None; covered.len()] };
        let index: BTreeMap<PatchId, usize> =
            all.keys.iter().enumerate().map(|(index, key)| (key.patch, index)).collect();
        for key in 0..all.keys.len() {
            let known = manifold.uncertainty_within(all.patch(key), NEIGHBOUR_STDS * std_m);
            all.take(key, known, &index);
        }
        for (index, of) in all.of.iter().enumerate() {
            if let Some((key, _)) = of {
                all.keys[*key].members.push(PatchId(index as u32));
            }
        }
        all.relate_members(manifold);
        all
    }

    /// Number of key patches.
    pub fn count(&self) -> usize {
        self.keys.len()
    }

    /// The key patch of an index.
    pub fn patch(&self, key: usize) -> PatchId {
        self.keys[key].patch
    }

    /// The index of the key patch from which a patch is known best, and `key_from_patch`.
    pub fn of(&self, patch: PatchId) -> Option<(usize, GaussianPose2)> {
        self.of[patch.index()]
    }

    /// The patches that are known best from a key patch, itself included, by id.
    pub fn members(&self, key: usize) -> &[PatchId] {
        &self.keys[key].members
    }

    /// All key patches of an island seen from one of them: composed along the path by way of key
    /// patches on which the position's variance grows least. They are known as well or better.
    pub fn known_from(&self, key: usize) -> BTreeMap<usize, GaussianPose2> {
        known_within(key, f64::INFINITY, |key| {
            self.keys[key].neighbours.iter().map(|(other, step)| (*other, *step))
        })
    }

    /// Takes what is known around a key patch: patches are given to the key patch from which they
    /// are known best, and other key patches become neighbours.
    fn take(
        &mut self,
        key: usize,
        known: BTreeMap<PatchId, GaussianPose2>,
        index: &BTreeMap<PatchId, usize>,
    ) {
        for (patch, belief) in known {
            let best = &mut self.of[patch.index()];
            if best.is_none_or(|(_, other)| {
                belief.position_variance_m2() < other.position_variance_m2()
            }) {
                *best = Some((key, belief));
            }
            if let Some(&other) = index.get(&patch)
                && other != key
            {
                self.keys[key].neighbours.insert(other, belief);
            }
        }
    }

    /// Relates key patches whose members are related, so that what hangs together does so by way of
    /// key patches too.
    fn relate_members(&mut self, manifold: &Manifold) {
        for relation in manifold.active_relations() {
            let ends = [relation.from, relation.to].map(|patch| self.of(patch));
            let [Some((from, from_from)), Some((to, to_from))] = ends else { continue };
            if from == to {
                continue;
            }
            let belief = from_from.compose(&relation.from_from_to).compose(&to_from.inverse());
            for (key, other, belief) in [(from, to, belief), (to, from, belief.inverse())] {
                let best = self.keys[key].neighbours.entry(other).or_insert(belief);
                if belief.position_variance_m2() < best.position_variance_m2() {
                    *best = belief;
                }
            }
        }
    }
}
