//! Maps for people and for other programs: occupancy grids, annotated images, outlines, reports.
//!
//! Everything here takes values and returns bytes or text; files are the caller's business. The
//! same input gives the same bytes, on one thread or many.
//!
//! 1. [`GridFrame`] says where the cells lie, [`ScanView`]s say what was seen from where;
//! 2. [`HitMissCounts`] counts, for every cell, the scans that hit it and the scans that looked
//!    through it;
//! 3. [`OccupancyGrid`] decides what is wall by an [`OccupancyRule`];
//! 4. [`map_png`], [`contact_sheet_png`], [`map_svg`], [`ros_map_pgm`] and [`Report`] show it.
//!
//! Figures rather than maps are drawn by [`plot`].
//!
//! ```
//! use geometry::Pose2;
//! use manifoldslam_rendering::*;
//! use sensing::{LaserModel, Scan};
//!
//! // A laser 2 m in front of a wall at x = 2.
//! let laser = LaserModel::half_circle(181);
//! let ranges: Vec<f32> = (0..181).map(|i| (2.0 / laser.bearing(i).cos()) as f32).collect();
//! let scan = Scan::classify(laser, &ranges);
//! let views = [ScanView { map_from_laser: Pose2::IDENTITY, scan: &scan }];
//!
//! let frame = GridFrame::around(&views, 0.5, 0.05)?;
//! let counts = HitMissCounts::cast(frame, &views, &CastSettings::default())?;
//! let grid = OccupancyGrid::decide(&counts, &OccupancyRule::default());
//! assert!(grid.count(Cell::Free) > 1000);
//!
//! let png = map_png(&grid, &Annotations { title: Some("one wall"), ..Annotations::default() })?;
//! assert!(png.starts_with(b"\x89PNG"));
//! # Ok::<(), RenderError>(())
//! ```

mod canvas;
mod contact_sheet;
mod contour;
mod counts;
mod decision;
mod error;
mod font;
mod frame;
mod legend;
mod map_image;
mod marks;
mod occupancy;
mod palette;
pub mod plot;
mod report;
mod ros_map;
mod svg;
mod sweep;
mod text;
mod view;

pub use contact_sheet::contact_sheet_png;
pub use contour::wall_outlines;
pub use counts::{CastSettings, HitMissCounts};
pub use error::RenderError;
pub use frame::GridFrame;
pub use map_image::{Annotations, Trajectory, map_png};
pub use marks::{ClosureMark, MarkKind};
pub use occupancy::{Cell, OccupancyGrid, OccupancyRule};
pub use report::Report;
pub use ros_map::{ros_map_pgm, ros_map_yaml};
pub use svg::map_svg;
pub use view::ScanView;
