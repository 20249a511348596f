use crate::canvas::{Canvas, Pen};
use crate::legend::Legend;
use crate::marks::in_drawing_order;
use crate::palette::{self, Ink};
use crate::{ClosureMark, OccupancyGrid, RenderError};
use geometry::{Pose2, Vector2};

/// A robot's path through the map.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory<'a> {
    /// What the legend calls it.
    pub name: &'a str,
    /// The robot's poses in the map frame, in the order they were passed.
    pub poses: &'a [Pose2],
}

/// What is drawn on and around a map.
#[derive(Clone, Copy, Debug)]
pub struct Annotations<'a> {
    /// A heading, for instance the name of the log or of the level.
    pub title: Option<&'a str>,
    /// Paths, one colour per robot in this order, with a start marker each. A robot without poses
    /// keeps its colour from being another's and is not named.
    pub trajectories: &'a [Trajectory<'a>],
    /// Patches, as small dots at their poses in the map frame.
    pub patches: &'a [Pose2],
    /// Loop closures, merges and what else joins patches.
    pub closures: &'a [ClosureMark],
    /// The bar that says how long a metre is.
    pub scale_bar: bool,
    /// The names of what is drawn.
    pub legend: bool,
    /// An arrow along map y. Off by default: a map's y axis is north only where someone made it so.
    pub north_arrow: bool,
    /// Pixels per cell; `None` picks 1, or more for maps smaller than a page.
    pub zoom: Option<usize>,
}

impl Default for Annotations<'_> {
    fn default() -> Self {
        Annotations {
            title: None,
            trajectories: &[],
            patches: &[],
            closures: &[],
            scale_bar: true,
            legend: true,
            north_arrow: false,
            zoom: None,
        }
    }
}

/// Small maps are enlarged until their longer side has about this many pixels.
const PAGE_PX: usize = 1400;
/// Most pixels of an image; zoom is given up before they are exceeded.
pub(crate) const MAX_PIXELS: usize = 1 << 28;

/// Draws a map as an indexed PNG in the style of the thesis: free space white, walls black, unknown
/// space a light blue-grey.
///
/// # Errors
/// [`RenderError::Encode`] where the image has more rows or columns than PNG allows.
pub fn map_png(grid: &OccupancyGrid, annotations: &Annotations) -> Result<Vec<u8>, RenderError> {
    map_canvas(grid, annotations).into_png()
}

/// A map as [`map_png`] draws it.
pub(crate) fn map_canvas(grid: &OccupancyGrid, annotations: &Annotations) -> Canvas {
    let frame = *grid.frame();
    let zoom = zoom(grid, annotations.zoom);
    let (width, height) = (frame.width * zoom, frame.height * zoom);
    let scale = Scale::of_image(width.max(height));
    let legend = Legend::new(annotations, frame.resolution_m / zoom as f64, width, scale);
    let mut canvas = Canvas::new(width, height + legend.height());
    paint_cells(&mut canvas, grid, zoom);

    let place = |p: Vector2<f64>| {
        let cells = frame.cells_from_map(p) * zoom as f64;
        Vector2::new(cells.x, height as f64 - cells.y)
    };
    canvas.clip_rows(height);
    draw_overlays(&mut canvas, annotations, scale, place);
    if annotations.north_arrow {
        draw_north(&mut canvas, width, scale);
    }
    canvas.clip_rows(usize::MAX);
    legend.draw(&mut canvas, height);
    canvas
}

fn zoom(grid: &OccupancyGrid, wanted: Option<usize>) -> usize {
    let frame = grid.frame();
    let longer = frame.width.max(frame.height).max(1);
    let zoom = wanted.unwrap_or((PAGE_PX + longer / 2) / longer).max(1);
    let fits = ((MAX_PIXELS / frame.len().max(1)) as f64).sqrt() as usize;
    zoom.min(fits.max(1))
}

/// Line widths and text sizes in proportion to the image.
#[derive(Clone, Copy)]
pub(crate) struct Scale {
    /// Pixels per unit; 1 for an image of about a page.
    pub unit: f64,
}

impl Scale {
    fn of_image(longer_px: usize) -> Self {
        Scale { unit: (longer_px as f64 / 1400.0).clamp(1.0, 12.0) }
    }

    /// Height of capitals.
    pub fn text(self) -> f64 {
        11.0 * self.unit
    }

    pub fn pen(self, ink: Ink, width: f64) -> Pen {
        Pen { ink, width: width * self.unit }
    }
}

fn paint_cells(canvas: &mut Canvas, grid: &OccupancyGrid, zoom: usize) {
    let height = grid.frame().height;
    for row in 0..height {
        let cells = grid.row(height - 1 - row);
        for repeat in 0..zoom {
            let pixels = canvas.row_mut(row * zoom + repeat);
            for (pixels, cell) in pixels.chunks_exact_mut(zoom).zip(cells) {
                pixels.fill(palette::base(*cell));
            }
        }
    }
}

fn draw_overlays(
    canvas: &mut Canvas,
    annotations: &Annotations,
    scale: Scale,
    place: impl Fn(Vector2<f64>) -> Vector2<f64>,
) {
    for (k, trajectory) in annotations.trajectories.iter().enumerate() {
        let points = trajectory.poses.iter().map(|p| place(p.translation()));
        canvas.polyline(points, scale.pen(Ink::Robot(k), 1.4));
    }
    for patch in annotations.patches {
        canvas.disc(place(patch.translation()), 1.6 * scale.unit, Ink::Patch);
    }
    for mark in in_drawing_order(annotations.closures) {
        mark.kind.style().draw(canvas, (place(mark.from), place(mark.to)), scale, 1.0);
    }
    for (k, trajectory) in annotations.trajectories.iter().enumerate() {
        if let Some(start) = trajectory.poses.first() {
            draw_start(canvas, place(start.translation()), start.yaw, k, scale);
        }
    }
}

/// A disc in the robot's colour with a stroke towards where it looked.
fn draw_start(canvas: &mut Canvas, at: Vector2<f64>, yaw: f64, robot: usize, scale: Scale) {
    let unit = scale.unit;
    let (s, c) = yaw.sin_cos();
    let nose = at + Vector2::new(c, -s) * 11.0 * unit;
    canvas.line(at, nose, scale.pen(Ink::Paper, 5.0));
    canvas.disc(at, 7.5 * unit, Ink::Paper);
    canvas.line(at, nose, scale.pen(Ink::Robot(robot), 2.4));
    canvas.disc(at, 5.5 * unit, Ink::Robot(robot));
}

fn draw_north(canvas: &mut Canvas, width: usize, scale: Scale) {
    let unit = scale.unit;
    let foot = Vector2::new(width as f64 - 24.0 * unit, 66.0 * unit);
    let at = |x: f64, y: f64| foot + Vector2::new(x, -y) * unit;
    canvas.line(at(0.0, 0.0), at(0.0, 28.0), scale.pen(Ink::Text, 2.0));
    canvas.triangle([at(-6.0, 24.0), at(6.0, 24.0), at(0.0, 40.0)], Ink::Text);
    let size = scale.text();
    let offset = Vector2::new(-0.5 * crate::font::width("N", size), 0.0);
    canvas.text("N", at(0.0, 45.0) + offset, size, Ink::Text);
}
