use crate::contour::{simplify, wall_outlines};
use crate::marks::{MarkStyle, in_drawing_order};
use crate::palette::Ink;
use crate::text::escape;
use crate::{Annotations, ClosureMark, GridFrame, OccupancyGrid};
use geometry::Vector2;
use std::fmt::Write;

/// The map as an SVG drawing: walls as filled outlines, paths and closures as lines. One unit is
/// one metre; y points up in the map and down in SVG, so drawing y is minus map y.
///
/// Outlines and paths are simplified to `tolerance_m`; half a cell keeps everything one can see.
pub fn map_svg(grid: &OccupancyGrid, annotations: &Annotations, tolerance_m: f64) -> String {
    let frame = grid.frame();
    let mut svg = header(frame, annotations.title);
    let mut walls = String::new();
    for ring in wall_outlines(grid, tolerance_m) {
        push_path(&mut walls, &ring);
        walls.push('Z');
    }
    let _ =
        writeln!(svg, "<path class=\"walls\" fill=\"#000\" fill-rule=\"evenodd\" d=\"{walls}\"/>");
    svg.push_str(&overlay_svg(annotations, tolerance_m, stroke_width(frame)));
    svg.push_str("</svg>\n");
    svg
}

/// Line width for drawings of this size, metres.
pub(crate) fn stroke_width(frame: &GridFrame) -> f64 {
    let size = frame.upper_right() - frame.origin;
    size.x.max(size.y) / 800.0
}

/// The view box in metres: left, top, width, height.
pub(crate) fn view_box(frame: &GridFrame) -> String {
    let size = frame.upper_right() - frame.origin;
    let (left, top) = (number(frame.origin.x), number(-frame.upper_right().y));
    format!("{left} {top} {} {}", number(size.x), number(size.y))
}

/// Paths, patches and closures as SVG elements in metres.
pub(crate) fn overlay_svg(annotations: &Annotations, tolerance_m: f64, width: f64) -> String {
    let mut svg = String::new();
    for (k, trajectory) in annotations.trajectories.iter().enumerate() {
        let points: Vec<_> = trajectory.poses.iter().map(|p| p.translation()).collect();
        let mut path = String::new();
        push_path(&mut path, &simplify(&points, tolerance_m));
        let (color, name) = (hex(Ink::Robot(k)), escape(trajectory.name));
        let _ = writeln!(
            svg,
            "<path class=\"path\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{}\" \
             stroke-linejoin=\"round\" d=\"{path}\"><title>{name}</title></path>",
            number(width),
        );
        if let Some(start) = points.first() {
            svg.push_str(&circle("start", *start, 4.0 * width, &color));
        }
    }
    for patch in annotations.patches {
        svg.push_str(&circle("patch", patch.translation(), 1.2 * width, &hex(Ink::Patch)));
    }
    for mark in in_drawing_order(annotations.closures) {
        push_mark(&mut svg, mark, width);
    }
    svg
}

fn push_mark(svg: &mut String, mark: &ClosureMark, unit: f64) {
    let (style, class) = (mark.kind.style(), mark.kind.class());
    let mut path = String::new();
    push_path(&mut path, &[mark.from, mark.to]);
    let line = |ink: Ink, width: f64, dash: &str| {
        format!(
            "<path class=\"closure {class}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{dash} \
             d=\"{path}\"/>\n",
            hex(ink),
            number(width * unit),
        )
    };
    if style.cased {
        svg.push_str(&line(Ink::Paper, style.width + 2.0 * MarkStyle::CASE, ""));
    }
    let dash = format!(" stroke-dasharray=\"{}\"", number(MarkStyle::DASH * unit));
    svg.push_str(&line(style.ink, style.width, if style.dashed { &dash } else { "" }));
    if style.ends {
        let class = format!("closure {class}");
        for end in [mark.from, mark.to] {
            svg.push_str(&circle(&class, end, MarkStyle::END * unit, &hex(style.ink)));
        }
    }
}

fn header(frame: &GridFrame, title: Option<&str>) -> String {
    let size = frame.upper_right() - frame.origin;
    let title = escape(title.unwrap_or("map"));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{}\" width=\"{}mm\" height=\"{}mm\">\n\
         <title>{title}</title>\n\
         <desc>One unit is one metre; drawing y is minus map y. Printed at 1:100.</desc>\n",
        view_box(frame),
        number(size.x * 10.0),
        number(size.y * 10.0),
    )
}

fn circle(class: &str, at: Vector2<f64>, radius: f64, color: &str) -> String {
    let (x, y, r) = (number(at.x), number(-at.y), number(radius));
    format!("<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{color}\"/>\n")
}

/// Points that are not finite are left out.
fn push_path(path: &mut String, points: &[Vector2<f64>]) {
    let mut command = 'M';
    for p in points.iter().filter(|p| p.iter().all(|v| v.is_finite())) {
        let _ = write!(path, "{command}{} {}", number(p.x), number(-p.y));
        command = 'L';
    }
}

/// Millimetres are as exact as a drawing needs.
fn number(value: f64) -> String {
    let rounded = (value * 1000.0).round() / 1000.0;
    // Adding zero turns -0 into 0.
    format!("{}", rounded + 0.0)
}

pub(crate) fn hex(ink: Ink) -> String {
    let [r, g, b] = ink.rgb();
    format!("#{r:02x}{g:02x}{b:02x}")
}
