use crate::args::Crop;
use crate::config::MapConfig;
use anyhow::{Context, Result};
use geometry::Vector2;
use manifold::{Manifold, Provenance};
use rendering::{ClosureMark, GridFrame, HitMissCounts, OccupancyGrid, RenderError, ScanView};

/// What the patches saw, from where.
pub fn patch_views(manifold: &Manifold) -> Vec<ScanView<'_>> {
    manifold
        .patches()
        .iter()
        .map(|patch| ScanView {
            map_from_laser: patch.island_from_patch * patch.base_from_laser,
            scan: &patch.scan,
        })
        .collect()
}

/// The loop closures as lines between their patches.
pub fn closure_marks(manifold: &Manifold) -> Vec<ClosureMark> {
    let place = |id| manifold.patch(id).island_from_patch.translation();
    manifold
        .relations()
        .iter()
        .filter(|relation| relation.provenance != Provenance::Sequential)
        .map(|relation| ClosureMark {
            from: place(relation.from),
            to: place(relation.to),
            accepted: relation.is_active(),
        })
        .collect()
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
