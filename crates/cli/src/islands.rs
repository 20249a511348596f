use manifold::{Manifold, PatchId};
use slam::Merge;
use std::cmp::Reverse;

/// Robots that a title names; of more it tells the number.
const NAMED: usize = 4;

/// The connected maps, largest first, as every file numbers them.
#[derive(Clone, Debug, Default)]
pub struct IslandList {
    /// The islands; of equal ones the one with the older patch comes first.
    pub islands: Vec<Island>,
    /// For each patch the index of its island; `None` for those left out.
    of: Vec<Option<usize>>,
}

/// A connected map.
#[derive(Clone, Debug)]
pub struct Island {
    /// Its patches, sorted.
    pub patches: Vec<PatchId>,
    /// Names of the robots with a patch on it, in the team's order.
    pub robots: Vec<String>,
}

impl IslandList {
    /// The islands of a map, without patches that are left out.
    pub fn of(manifold: &Manifold) -> Self {
        let mut members = manifold.islands();
        for patches in &mut members {
            patches.retain(|id| !manifold.patch(*id).left_out);
        }
        members.retain(|patches| !patches.is_empty());
        members.sort_by_key(|patches| (Reverse(patches.len()), patches[0]));
        let mut of = vec![None; manifold.patches().len()];
        for (k, patches) in members.iter().enumerate() {
            patches.iter().for_each(|patch| of[patch.index()] = Some(k));
        }
        let island = |patches: Vec<PatchId>| {
            let mut robots: Vec<_> = patches.iter().map(|id| manifold.patch(*id).robot).collect();
            robots.sort_unstable();
            robots.dedup();
            let name = |r: &sensing::RobotId| manifold.robots()[usize::from(r.0)].name.to_string();
            Island { robots: robots.iter().map(name).collect(), patches }
        };
        IslandList { islands: members.into_iter().map(island).collect(), of }
    }

    /// The index of a patch's island; `None` for a patch that is left out.
    pub fn index(&self, patch: PatchId) -> Option<usize> {
        self.of[patch.index()]
    }

    /// Those merges of which a relation leads from one patch that is not left out to another.
    pub fn merges(&self, manifold: &Manifold, merges: &[Merge]) -> Vec<Merge> {
        let is_drawn = |merge: &&Merge| {
            let mut relations = merge.relations.iter().map(|id| manifold.relation(*id));
            relations.any(|r| self.index(r.from).is_some() && self.index(r.to).is_some())
        };
        merges.iter().filter(is_drawn).cloned().collect()
    }
}

/// The file of an island's map: `map.png` for the first, `map-2.png` for the second.
pub fn map_file(island: usize, ending: &str) -> String {
    match island {
        0 => format!("map.{ending}"),
        k => format!("map-{}.{ending}", k + 1),
    }
}

/// Robots' names as a title has room for them.
pub fn title(robots: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = robots.iter().map(AsRef::as_ref).collect();
    if names.len() <= NAMED {
        return names.join(", ");
    }
    format!("{} and {} more", names[..NAMED - 1].join(", "), names.len() - NAMED + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_stay_short() {
        assert_eq!(title(&["a"]), "a");
        assert_eq!(title(&["a", "b", "c", "d"]), "a, b, c, d");
        assert_eq!(title(&["a", "b", "c", "d", "e"]), "a, b, c and 2 more");
    }

    #[test]
    fn the_first_map_has_no_number() {
        assert_eq!(
            (map_file(0, "png"), map_file(1, "pgm")),
            ("map.png".into(), "map-2.pgm".into())
        );
    }
}
