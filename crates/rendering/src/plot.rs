//! Plots for people who compare figures: panels with lines and marks, and heat maps, as PNG.
//!
//! The caller decides what is drawn in which colour; this module lays out, labels and draws.

mod axis;
mod heat;
mod layout;
mod panel;
mod series;
mod sheet;

pub use axis::{Axis, AxisKind};
pub use heat::{HeatSheet, heat_map_color};
pub use layout::PanelSheet;
pub use panel::Panel;
pub use series::{Line, Mark, Series};

/// A colour: red, green, blue.
pub type Color = [u8; 3];

/// The ink of axes and text.
pub const INK: Color = [34, 40, 49];
/// The ink of what stands behind the figures: walls, grid lines, figures of others.
pub const FAINT: Color = [214, 219, 227];

/// Colours that can be told apart on white, for up to sixteen series; later ones repeat them.
pub fn series_color(index: usize) -> Color {
    const COLORS: [Color; 16] = [
        [31, 119, 180],
        [230, 110, 0],
        [44, 150, 44],
        [205, 35, 40],
        [138, 90, 190],
        [130, 80, 65],
        [220, 90, 180],
        [0, 165, 185],
        [165, 165, 0],
        [20, 50, 120],
        [120, 200, 70],
        [90, 20, 60],
        [255, 160, 120],
        [100, 110, 120],
        [0, 110, 90],
        [180, 140, 220],
    ];
    COLORS[index % COLORS.len()]
}

/// Width and height of the diagram within a panel of this size, pixels: equal scales on both axes
/// need it.
pub fn inner_size((width, height): (f64, f64)) -> (f64, f64) {
    let [left, top, right, bottom] = panel::MARGIN;
    (width - left - right, height - top - bottom)
}
