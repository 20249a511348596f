use crate::args::Crop;
use crate::config::MapConfig;
use crate::islands::IslandList;
use anyhow::{Context, Result};
use geometry::Vector2;
use manifold::{Manifold, Provenance, Relation, RelationState};
use rendering::{
    ClosureMark, GridFrame, HitMissCounts, MarkKind, OccupancyGrid, RenderError, ScanView,
};

/// What joins the patches of one island beside the robots' ways, as lines. A relation between two
/// islands has no place on either map.
pub fn closure_marks(manifold: &Manifold, islands: &IslandList, island: usize) -> Vec<ClosureMark> {
    let place = |id| manifold.patch(id).island_from_patch.translation();
    let inside =
        |r: &&Relation| [r.from, r.to].iter().all(|end| islands.index(*end) == Some(island));
    let drawn = manifold.relations().iter().filter(|r| r.provenance != Provenance::Sequential);
    drawn
        .filter(inside)
        .map(|r| ClosureMark { from: place(r.from), to: place(r.to), kind: mark_kind(r) })
        .collect()
}

fn mark_kind(relation: &Relation) -> MarkKind {
    match (relation.state, relation.provenance) {
        (RelationState::Retracted(_), _) => MarkKind::Rejected,
        (RelationState::Provisional, _) => MarkKind::Provisional,
        (_, Provenance::Landmark) => MarkKind::Landmark,
        (_, Provenance::Merge) => MarkKind::Merge,
        (_, Provenance::Rendezvous) => MarkKind::Rendezvous,
        (_, Provenance::Sequential | Provenance::LoopClosure) => MarkKind::Closure,
    }
}

/// Casts scans into a grid and decides what is wall.
pub fn occupancy(
    views: &[ScanView],
    config: &MapConfig,
    crop: Option<&Crop>,
) -> Result<OccupancyGrid> {
    let frame = match crop {
        Some(Crop { min, max }) => {
            let corner = |c: &(f64, f64)| Vector2::new(c.0, c.1);
            GridFrame::covering(corner(min), corner(max), config.resolution_m)
        }
        None => GridFrame::around(views, config.margin_m, config.resolution_m),
    };
    let frame = frame.context("cannot lay out the map")?;
    let counts = HitMissCounts::cast(frame, views, &config.cast)?;
    let grid = OccupancyGrid::decide(&counts, &config.rule);
    Ok(if crop.is_some() { grid } else { grid.trimmed(config.margin_m) })
}

/// As [`occupancy`], at a coarser resolution where the map would be too large for the configured
/// one: a finished run must not be lost for its picture.
pub fn occupancy_that_fits(views: &[ScanView], mut config: MapConfig) -> Result<OccupancyGrid> {
    loop {
        let frame = GridFrame::around(views, config.margin_m, config.resolution_m);
        match frame {
            Err(RenderError::TooLarge { .. }) if config.resolution_m < 10.0 => {
                config.resolution_m *= 2.0;
            }
            _ => return occupancy(views, &config, None),
        }
    }
}
