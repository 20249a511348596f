use crate::canvas::Canvas;
use crate::map_image::{Annotations, Scale};
use crate::palette::Ink;
use crate::{MarkKind, font};
use geometry::Vector2;

/// The strip below a map: title, scale bar and the names of what is drawn, broken into lines.
pub(crate) struct Legend {
    items: Vec<(Placed, Item)>,
    height: usize,
    scale: Scale,
}

enum Item {
    Title(String),
    ScaleBar { pixels: f64, label: String },
    Named { symbol: Symbol, name: String },
}

#[derive(Clone, Copy)]
enum Symbol {
    Path(usize),
    Patch,
    Mark(MarkKind),
}

/// Left end of the base line, relative to the strip's upper left corner, in pixels.
type Placed = Vector2<f64>;

/// Space between the drawing of an item and its name, and between items, in capitals' heights.
const GAP: f64 = 0.7;
const ITEM_GAP: f64 = 2.2;
const LINE: f64 = 2.2;
const SYMBOL: f64 = 2.0;

impl Legend {
    /// Lays the strip out for an image `width` pixels wide, `metres_per_pixel` each.
    pub fn new(
        annotations: &Annotations,
        metres_per_pixel: f64,
        width: usize,
        scale: Scale,
    ) -> Self {
        let size = scale.text();
        let left = 1.2 * size;
        let (mut x, mut y) = (left, 2.1 * size);
        let mut items = Vec::new();
        for item in collect(annotations, metres_per_pixel, width) {
            let item_width = item.width(size);
            if x > left && x + item_width > width as f64 - left {
                (x, y) = (left, y + LINE * size);
            }
            items.push((Vector2::new(x, y), item));
            x += item_width + ITEM_GAP * size;
        }
        let height = if items.is_empty() { 0 } else { (y + 1.2 * size).ceil() as usize };
        Legend { items, height, scale }
    }

    /// Rows of pixels the strip takes.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Draws the strip below row `top`.
    pub fn draw(&self, canvas: &mut Canvas, top: usize) {
        for (placed, item) in &self.items {
            item.draw(canvas, placed + Vector2::new(0.0, top as f64), self.scale);
        }
    }
}

fn collect(annotations: &Annotations, metres_per_pixel: f64, width: usize) -> Vec<Item> {
    let mut items = Vec::new();
    items.extend(annotations.title.map(|title| Item::Title(title.to_owned())));
    if annotations.scale_bar {
        let metres = round_length(0.2 * width as f64 * metres_per_pixel);
        items.push(Item::ScaleBar { pixels: metres / metres_per_pixel, label: label(metres) });
    }
    if annotations.legend {
        let named = |symbol, name: &str| Item::Named { symbol, name: name.to_owned() };
        let paths = annotations.trajectories.iter().enumerate();
        let paths = paths.filter(|(_, t)| !t.poses.is_empty());
        items.extend(paths.map(|(k, t)| named(Symbol::Path(k), t.name)));
        items.extend((!annotations.patches.is_empty()).then(|| named(Symbol::Patch, "patch")));
        let present = |kind: &MarkKind| annotations.closures.iter().any(|c| c.kind == *kind);
        let kinds = MarkKind::ALL.into_iter().filter(present);
        items.extend(kinds.map(|kind| named(Symbol::Mark(kind), kind.name())));
    }
    items
}

impl Item {
    fn width(&self, size: f64) -> f64 {
        match self {
            Item::Title(text) => font::width(text, size),
            Item::ScaleBar { pixels, label } => pixels + GAP * size + font::width(label, size),
            Item::Named { name, .. } => (SYMBOL + GAP) * size + font::width(name, size),
        }
    }

    fn draw(&self, canvas: &mut Canvas, at: Vector2<f64>, scale: Scale) {
        let size = scale.text();
        match self {
            Item::Title(text) => canvas.text(text, at, size, Ink::Text),
            Item::ScaleBar { pixels, label } => {
                let pen = scale.pen(Ink::Text, 2.0);
                let point = |x: f64, y: f64| at + Vector2::new(x, -y * size);
                canvas.line(point(0.0, 0.3), point(*pixels, 0.3), pen);
                for x in [0.0, *pixels] {
                    canvas.line(point(x, 0.0), point(x, 0.6), pen);
                }
                canvas.text(label, point(pixels + GAP * size, 0.0), size, Ink::Text);
            }
            Item::Named { symbol, name } => {
                symbol.draw(canvas, at - Vector2::new(0.0, 0.45 * size), scale);
                let text_at = at + Vector2::new((SYMBOL + GAP) * size, 0.0);
                canvas.text(name, text_at, size, Ink::Text);
            }
        }
    }
}

impl Symbol {
    /// Draws it from its left end at the middle of the line.
    fn draw(self, canvas: &mut Canvas, at: Vector2<f64>, scale: Scale) {
        let end = at + Vector2::new(SYMBOL * scale.text(), 0.0);
        match self {
            Symbol::Path(k) => {
                canvas.line(at, end, scale.pen(Ink::Robot(k), 1.8));
                canvas.disc(at, 4.0 * scale.unit, Ink::Robot(k));
            }
            Symbol::Patch => canvas.disc((at + end) / 2.0, 2.2 * scale.unit, Ink::Patch),
            Symbol::Mark(kind) => kind.style().draw(canvas, (at, end), scale, 1.4),
        }
    }
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `metres`.
fn round_length(metres: f64) -> f64 {
    if !(metres.is_finite() && metres > 0.0) {
        return 1.0;
    }
    let decade = 10.0_f64.powf(metres.log10().floor());
    let steps = [5.0, 2.0, 1.0].into_iter().map(|step| step * decade);
    steps.into_iter().find(|length| *length <= metres).unwrap_or(decade)
}

fn label(metres: f64) -> String {
    let rounded = |value: f64| (value * 1000.0).round() / 1000.0;
    if metres >= 1.0 {
        format!("{} m", rounded(metres))
    } else {
        format!("{} cm", rounded(metres * 100.0))
    }
}
