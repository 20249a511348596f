use super::common_ground::{CommonGround, Seen};
use super::estimate::Usual;
use super::surroundings::Doubt;
use crate::SlamConfig;
use crate::loop_closing::Verifier;
use crate::map::Map;
use crate::patch_grid::PatchGrid;
use manifold::{Islands, PatchId, Provenance, Relation};
use rayon::prelude::*;

/// Share of sight lines that pass through walls where a robot comes back to the same place, by
/// people and doors that moved: what is taken before anything is measured, and for how many
/// closures that counts.
const USUALLY_THROUGH: f64 = 0.015;
const USUAL_CLOSURES: f64 = 4.0;
/// Closures that are looked at to find out.
const MOST_CLOSURES: usize = 60;

/// What robots find changed where they come back to places of their own maps: how much they see
/// through walls, and what surfaces they contradict.
pub(super) fn usual(map: &Map, islands: &Islands, grid: &PatchGrid, config: &SlamConfig) -> Usual {
    let closures = map.manifold.active_relations();
    let closures: Vec<Relation> =
        closures.filter(|r| r.provenance == Provenance::LoopClosure).copied().collect();
    let step = closures.len().div_ceil(MOST_CLOSURES).max(1);
    let looked_at: Vec<Relation> = closures.into_iter().step_by(step).collect();
    let verifier = Verifier::new(&config.for_merging());
    let through: Vec<f64> = looked_at
        .par_iter()
        .map_init(
            || verifier.clone(),
            |verifier, r| verifier.contradiction(r.to, r.from, &r.from_from_to.mean, map).max(0.0),
        )
        .collect();
    let seen_through = (USUAL_CLOSURES * USUALLY_THROUGH + through.iter().sum::<f64>())
        / (USUAL_CLOSURES + through.len() as f64);
    let visits = |r: &Relation| {
        let from_place = r.from_from_to.mean;
        Seen { place: r.to, from: r.from, from_place, doubt: Doubt::NONE }
    };
    let seen: Vec<Seen> = looked_at.iter().map(visits).collect();
    let ground = CommonGround::of(map, grid, &islands.of, &seen, |seen, patch, is_place| {
        is_of_visit(map, seen, patch, is_place)
    });
    Usual { seen_through, compared_m: ground.compared_m, pieces: ground.pieces }
}

/// True for the robot's patches that were taken nearer in time to the one visit than to the other.
fn is_of_visit(map: &Map, seen: &Seen, patch: PatchId, is_place: bool) -> bool {
    let robot = |patch: PatchId| map.manifold.patch(patch).robot;
    let apart = |other: PatchId| patch.0.abs_diff(other.0);
    let (own, other) = if is_place { (seen.place, seen.from) } else { (seen.from, seen.place) };
    robot(patch) == robot(own) && apart(own) < apart(other)
}
