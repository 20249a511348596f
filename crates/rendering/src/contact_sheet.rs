use crate::canvas::Canvas;
use crate::map_image::{MAX_PIXELS, map_canvas};
use crate::{Annotations, OccupancyGrid, RenderError};

/// Space between the maps of a sheet, pixels.
const GAP_PX: usize = 24;

/// Several maps on one sheet, in rows from the upper left corner: the levels of a building, for
/// instance. Each is drawn as [`crate::map_png`] draws it, all with the zoom of the smallest
/// choice, so that a metre is as long on each.
///
/// # Errors
/// [`RenderError::Empty`] without maps; [`RenderError::Encode`] where the sheet has more rows or
/// columns than PNG allows.
pub fn contact_sheet_png(maps: &[(&OccupancyGrid, Annotations)]) -> Result<Vec<u8>, RenderError> {
    let columns = (maps.len() as f64).sqrt().ceil() as usize;
    let longest = maps.iter().map(|(grid, _)| grid.frame().width.max(grid.frame().height)).max();
    let longest = longest.ok_or(RenderError::Empty)?.max(1);
    let largest = maps.iter().map(|(grid, _)| grid.frame().len()).max().unwrap_or(0).max(1);
    let fits = ((MAX_PIXELS / (largest * maps.len())) as f64).sqrt() as usize;
    let zoom = (SHEET_PX / longest).clamp(1, fits.max(1));
    let drawn: Vec<Canvas> = maps
        .iter()
        .map(|(grid, annotations)| {
            map_canvas(grid, &Annotations { zoom: Some(zoom), ..*annotations })
        })
        .collect();
    let width = drawn.iter().map(Canvas::width).max().unwrap_or(0);
    let rows: Vec<&[Canvas]> = drawn.chunks(columns).collect();
    let heights = rows.iter().map(|row| row.iter().map(Canvas::height).max().unwrap_or(0));
    let heights: Vec<usize> = heights.collect();
    let sheet_height = heights.iter().sum::<usize>() + GAP_PX * (rows.len() - 1);
    let mut sheet = Canvas::new(width * columns + GAP_PX * (columns - 1), sheet_height);
    let mut top = 0;
    for (row, height) in rows.iter().zip(heights) {
        for (k, map) in row.iter().enumerate() {
            sheet.paste(map, k * (width + GAP_PX), top);
        }
        top += height + GAP_PX;
    }
    sheet.into_png()
}

/// Longer side of a map on a sheet, pixels.
const SHEET_PX: usize = 1000;
