use crate::{Manifold, PatchId};
use std::collections::{BTreeMap, VecDeque};

/// Floors of one building lie at least this far above each other, metres: what a robot or a person
/// needs to pass below. Flat stretches nearer than this to a level are landings.
const LEAST_STOREY_M: f64 = 2.0;
/// A landing this near to a level belongs to its floor, metres: a step, a threshold, an error.
const SAME_FLOOR_M: f64 = 0.5;
/// Neighbours that differ by more than this a metre lie on a ramp: 3 %, between what passes for a
/// floor (1.5 degrees are 2.6 %) and the flattest ramp for wheels (5 %).
const RAMP_SLOPE: f64 = 0.03;
/// Differences below this are no ramp however short the way, metres.
const RAMP_M: f64 = 0.03;
/// A stretch of fewer patches is no floor.
const LEAST_PATCHES: usize = 3;

/// Whether a patch lies on a floor or between floors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GroundKind {
    /// On a level.
    Flat,
    /// On a ramp, stairs or a landing: between levels.
    Ramp,
}

/// Where a patch belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelMember {
    /// The patch.
    pub patch: PatchId,
    /// Its level, 0 the lowest; for a ramp's patches the nearest in height.
    pub level: usize,
    /// What it stands on.
    pub ground: GroundKind,
}

/// The levels of an island: flat stretches above each other, and ramps between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Levels {
    /// Heights above the island's first patch, metres, from the lowest level up; never empty for an
    /// island of any patches.
    pub heights_m: Vec<f64>,
    /// The island's patches in the order they were given.
    pub members: Vec<LevelMember>,
}

impl Levels {
    /// The patches of one level, its ramps' patches included.
    pub fn patches(&self, level: usize) -> impl Iterator<Item = PatchId> {
        self.members.iter().filter(move |m| m.level == level).map(|m| m.patch)
    }

    /// Where a patch belongs; `None` outside the island.
    pub fn of(&self, patch: PatchId) -> Option<LevelMember> {
        // Islands are sorted by patch.
        let found = self.members.binary_search_by_key(&patch, |m| m.patch);
        found.ok().map(|index| self.members[index])
    }
}

/// A connected piece of level ground.
struct Stretch {
    patches: usize,
    height_m: f64,
}

impl Manifold {
    /// The levels of an island, given as a sorted list of its patches: flat stretches are joined
    /// along ways and relations; from the largest on, those at least 2 m away from every level
    /// found so far make a new one (docs/math/elevation.md). Patches of unknown height go with
    /// their nearest neighbour along the graph; where no height is known, all is one level.
    pub fn levels(&self, island: &[PatchId]) -> Levels {
        let heights = self.heights_of(island);
        let graph = self.steps_within(island);
        let (stretch_of, stretches) = flat_stretches(&heights, &graph);
        let heights_m = floors(&stretches);
        let nearest = |height: f64| {
            let distance = |level: &usize| (heights_m[*level] - height).abs();
            let best = (0..heights_m.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            best.unwrap_or(0)
        };
        let member = |(index, &patch): (usize, &PatchId)| {
            let level = nearest(heights[index]);
            let stretch = &stretches[stretch_of[index]];
            let flat = stretch.patches >= LEAST_PATCHES.min(island.len())
                && (stretch.height_m - heights_m[level]).abs() < SAME_FLOOR_M;
            let ground = if flat { GroundKind::Flat } else { GroundKind::Ramp };
            LevelMember { patch, level, ground }
        };
        let members = island.iter().enumerate().map(member).collect();
        Levels { heights_m, members }
    }

    /// Heights of an island's patches, unknown ones taken from the nearest along the graph; zero
    /// where none is known.
    fn heights_of(&self, island: &[PatchId]) -> Vec<f64> {
        let mut known: BTreeMap<PatchId, f64> = BTreeMap::new();
        let mut frontier = VecDeque::new();
        for &patch in island {
            if let Some(elevation) = self.patch(patch).elevation {
                known.insert(patch, elevation.height_m);
                frontier.push_back(patch);
            }
        }
        while let Some(patch) = frontier.pop_front() {
            let height = known[&patch];
            for (other, _) in self.neighbours(patch) {
                known.entry(other).or_insert_with(|| {
                    frontier.push_back(other);
                    height
                });
            }
        }
        island.iter().map(|patch| known.get(patch).copied().unwrap_or(0.0)).collect()
    }

    /// Steps between an island's patches, by index: both ends and the distance on the plan.
    fn steps_within(&self, island: &[PatchId]) -> Vec<(usize, usize, f64)> {
        let relations = self.active_relations().map(|r| (r.from, r.to));
        let ways = self.ways().iter().map(|way| (way.from, way.to));
        let index = |patch: PatchId| island.binary_search(&patch).ok();
        relations
            .chain(ways)
            .filter_map(|(from, to)| {
                let step = self.patch(from).island_from_patch;
                let distance = step.distance(&self.patch(to).island_from_patch);
                Some((index(from)?, index(to)?, distance))
            })
            .collect()
    }
}

/// The stretch of every patch, and the stretches: patches joined by steps that do not climb.
fn flat_stretches(heights: &[f64], steps: &[(usize, usize, f64)]) -> (Vec<usize>, Vec<Stretch>) {
    let climbs = |&(a, b, distance): &(usize, usize, f64)| {
        (heights[a] - heights[b]).abs() > (RAMP_SLOPE * distance).max(RAMP_M)
    };
    // A patch that one climbs to or from is no floor.
    let mut sloping = vec![false; heights.len()];
    for &(a, b, _) in steps.iter().filter(|step| climbs(step)) {
        (sloping[a], sloping[b]) = (true, true);
    }
    let mut root: Vec<usize> = (0..heights.len()).collect();
    for &(a, b, _) in steps.iter().filter(|step| !climbs(step)) {
        if !sloping[a] && !sloping[b] {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b)] = a.min(b);
        }
    }
    let roots: Vec<usize> = (0..heights.len()).map(|i| find(&mut root, i)).collect();
    let mut stretches: Vec<Stretch> = Vec::new();
    let mut stretch_at = BTreeMap::new();
    let mut of = Vec::with_capacity(heights.len());
    for (&root, height) in roots.iter().zip(heights) {
        let index = *stretch_at.entry(root).or_insert_with(|| {
            stretches.push(Stretch { patches: 0, height_m: 0.0 });
            stretches.len() - 1
        });
        let stretch = &mut stretches[index];
        stretch.patches += 1;
        stretch.height_m += (height - stretch.height_m) / stretch.patches as f64;
        of.push(index);
    }
    (of, stretches)
}

/// The representative of a set, the path to it shortened (union-find).
fn find(root: &mut [usize], mut index: usize) -> usize {
    while root[index] != index {
        root[index] = root[root[index]];
        index = root[index];
    }
    index
}

/// Heights of the levels, the lowest first.
fn floors(stretches: &[Stretch]) -> Vec<f64> {
    let mut by_size: Vec<&Stretch> = stretches.iter().collect();
    by_size.sort_by_key(|stretch| std::cmp::Reverse(stretch.patches));
    let mut floors: Vec<(f64, f64)> = Vec::new();
    for stretch in by_size {
        let (height, weight) = (stretch.height_m, stretch.patches as f64);
        let near = |floor: &&mut (f64, f64)| (floor.0 - height).abs() < SAME_FLOOR_M;
        if let Some(floor) = floors.iter_mut().find(near) {
            floor.1 += weight;
            floor.0 += (height - floor.0) * weight / floor.1;
        } else if floors.is_empty()
            || (stretch.patches >= LEAST_PATCHES
                && floors.iter().all(|f| (f.0 - height).abs() >= LEAST_STOREY_M))
        {
            floors.push((height, weight));
        }
    }
    let mut heights: Vec<f64> = floors.iter().map(|floor| floor.0).collect();
    heights.sort_by(f64::total_cmp);
    heights
}
