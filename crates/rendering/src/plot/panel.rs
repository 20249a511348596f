use super::sheet::{Anchor, Sheet};
use super::{Axis, FAINT, INK, Line, Mark, Series};
use crate::canvas::clip_segment;
use crate::font;
use geometry::Vector2;

/// One diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What it shows.
    pub title: String,
    /// The axis to the right.
    pub x: Axis,
    /// The axis upwards.
    pub y: Axis,
    /// What is drawn, later ones above earlier ones.
    pub series: Vec<Series>,
}

/// Height of capitals: titles, labels, ticks.
pub(super) const TITLE: f64 = 13.0;
pub(super) const LABEL: f64 = 10.5;
pub(super) const TICK: f64 = 9.0;
/// Room around a panel's diagram: left, top, right, bottom.
pub(super) const MARGIN: [f64; 4] = [84.0, 44.0, 22.0, 58.0];

impl Panel {
    /// Draws the panel into a box.
    pub(super) fn draw(&self, sheet: &mut Sheet, low: Vector2<f64>, high: Vector2<f64>) {
        let low = low + Vector2::new(MARGIN[0], MARGIN[1]);
        let high = high - Vector2::new(MARGIN[2], MARGIN[3]);
        let title = Vector2::new(low.x, low.y - 14.0);
        sheet.text(&self.title, title, TITLE, Anchor::Left, INK);
        self.draw_axes(sheet, low, high);
        let place = |&(x, y): &(f64, f64)| {
            let (x, y) = (self.x.place(x), self.y.place(y));
            Vector2::new(low.x + x * (high.x - low.x), high.y - y * (high.y - low.y))
        };
        for series in &self.series {
            let points: Vec<_> = series
                .points
                .iter()
                .map(place)
                .filter(|p| p.iter().all(|v| v.is_finite()))
                .collect();
            draw_lines(sheet, series, &points, low, high);
            for at in points.iter().filter(|p| within(p, low, high)) {
                draw_mark(sheet, series, *at);
            }
        }
        self.draw_labels(sheet, &place, low, high);
        sheet.frame(low, high, INK);
    }

    fn draw_axes(&self, sheet: &mut Sheet, low: Vector2<f64>, high: Vector2<f64>) {
        for tick in self.x.ticks((high.x - low.x) / 70.0) {
            let x = low.x + tick.at * (high.x - low.x);
            let width = if tick.label.is_empty() { 0.4 } else { 1.0 };
            sheet.line(Vector2::new(x, low.y), Vector2::new(x, high.y), FAINT, width);
            let below = Vector2::new(x, high.y + 18.0);
            sheet.text(&tick.label, below, TICK, Anchor::Middle, INK);
        }
        for tick in self.y.ticks((high.y - low.y) / 45.0) {
            let y = high.y - tick.at * (high.y - low.y);
            let width = if tick.label.is_empty() { 0.4 } else { 1.0 };
            sheet.line(Vector2::new(low.x, y), Vector2::new(high.x, y), FAINT, width);
            let left = Vector2::new(low.x - 8.0, y + 0.5 * TICK);
            sheet.text(&tick.label, left, TICK, Anchor::Right, INK);
        }
        let middle = 0.5 * (low + high);
        let below = Vector2::new(middle.x, high.y + 42.0);
        sheet.text(&self.x.label, below, LABEL, Anchor::Middle, INK);
        sheet.text_up(&self.y.label, Vector2::new(low.x - 62.0, middle.y), LABEL, INK);
    }

    /// Names beside their points, each where it covers neither a point nor another name.
    fn draw_labels(
        &self,
        sheet: &mut Sheet,
        place: &impl Fn(&(f64, f64)) -> Vector2<f64>,
        low: Vector2<f64>,
        high: Vector2<f64>,
    ) {
        let labelled = || self.series.iter().filter(|s| s.labelled && !s.name.is_empty());
        let mut taken: Vec<(Vector2<f64>, Vector2<f64>)> = labelled()
            .filter_map(|s| s.points.first())
            .map(|p| (place(p).add_scalar(-6.0), place(p).add_scalar(6.0)))
            .collect();
        for series in labelled() {
            let Some(at) = series.points.first().map(place) else { continue };
            let width = font::width(&series.name, TICK);
            let corner = (0..60)
                .map(|k| {
                    // Around the point, then farther away.
                    let away = 9.0 + 11.0 * f64::from(k / 6);
                    let (dx, dy) = [
                        (1.0, 0.5),
                        (-1.0, 0.5),
                        (0.0, -1.0),
                        (0.0, 2.0),
                        (1.0, -1.0),
                        (-1.0, -1.0),
                    ][(k % 6) as usize];
                    let left = at.x + dx * away - if dx < 0.0 { width } else { 0.0 };
                    let left = if dx == 0.0 { at.x - 0.5 * width } else { left };
                    Vector2::new(left, at.y + dy * if dx == 0.0 { away } else { TICK })
                })
                .find(|corner| {
                    let (lo, hi) = text_box(*corner, width);
                    let free = |&(a, b): &(Vector2<f64>, Vector2<f64>)| {
                        hi.x < a.x || lo.x > b.x || hi.y < a.y || lo.y > b.y
                    };
                    within(&lo, low, high) && within(&hi, low, high) && taken.iter().all(free)
                });
            let Some(corner) = corner else { continue };
            let (lo, hi) = text_box(corner, width);
            taken.push((lo, hi));
            // Lines must not run through a name.
            sheet.fill(lo.add_scalar(1.0), hi.add_scalar(-1.0), [255; 3]);
            sheet.text(&series.name, corner, TICK, Anchor::Left, series.color);
        }
    }
}

/// The box around text whose base line begins at a point.
fn text_box(corner: Vector2<f64>, width: f64) -> (Vector2<f64>, Vector2<f64>) {
    (corner - Vector2::new(2.0, TICK + 2.0), corner + Vector2::new(width + 2.0, 4.0))
}

fn within(p: &Vector2<f64>, low: Vector2<f64>, high: Vector2<f64>) -> bool {
    (p - low).min() >= -0.5 && (high - p).min() >= -0.5
}

fn draw_lines(
    sheet: &mut Sheet,
    series: &Series,
    points: &[Vector2<f64>],
    low: Vector2<f64>,
    high: Vector2<f64>,
) {
    let mut along = 0.0;
    let mut draw = |a: Vector2<f64>, b: Vector2<f64>| {
        if let Some((from, to)) = clip_segment(a, b, low, high) {
            match series.line {
                Line::Dashed => {
                    sheet.dashed(from, to, series.color, 1.4, along + (from - a).norm());
                }
                _ => sheet.line(from, to, series.color, 1.8),
            }
        }
        along += (b - a).norm();
    };
    match series.line {
        Line::None => {}
        Line::Solid | Line::Dashed => points.windows(2).for_each(|w| draw(w[0], w[1])),
        Line::Pairs => points.chunks_exact(2).for_each(|w| draw(w[0], w[1])),
    }
}

pub(super) fn draw_mark(sheet: &mut Sheet, series: &Series, at: Vector2<f64>) {
    match series.mark {
        Mark::None => {}
        Mark::Speck => sheet.disc(at, 1.2, series.color),
        Mark::Dot => sheet.disc(at, 2.4, series.color),
        Mark::Disc => sheet.disc(at, 4.2, series.color),
        Mark::Ring => {
            sheet.disc(at, 4.0, [255; 3]);
            sheet.ring(at, 4.0, series.color, 1.4);
        }
        Mark::Square => sheet.square(at, 3.6, false, series.color),
        Mark::Diamond => sheet.square(at, 3.9, true, series.color),
    }
}
