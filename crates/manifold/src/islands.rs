use crate::{Manifold, PatchId};

/// The connected components of a manifold.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Islands {
    /// Each island's patches, sorted; islands in the order of their first patch.
    pub members: Vec<Vec<PatchId>>,
    /// For each patch the index of its island in `members`.
    pub of: Vec<u32>,
}

impl Islands {
    /// The index of a patch's island.
    pub fn of(&self, patch: PatchId) -> usize {
        self.of[patch.index()] as usize
    }
}

impl Manifold {
    /// The connected components: each a sorted list of patches, in the order of their first patch.
    pub fn islands(&self) -> Vec<Vec<PatchId>> {
        self.component_map().members
    }

    /// The connected components, with the island of every patch.
    pub fn component_map(&self) -> Islands {
        let unknown = u32::MAX;
        let mut of = vec![unknown; self.patches().len()];
        let mut members = Vec::new();
        for start in 0..of.len() {
            if of[start] != unknown {
                continue;
            }
            let index = members.len() as u32;
            of[start] = index;
            let mut island = vec![PatchId(start as u32)];
            let mut next = 0;
            while next < island.len() {
                for (other, _) in self.neighbours(island[next]) {
                    if of[other.index()] == unknown {
                        of[other.index()] = index;
                        island.push(other);
                    }
                }
                next += 1;
            }
            island.sort_unstable();
            members.push(island);
        }
        Islands { members, of }
    }
}
