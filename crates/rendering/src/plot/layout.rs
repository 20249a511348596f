use super::panel::{LABEL, TITLE, draw_mark};
use super::sheet::{Anchor, Sheet};
use super::{INK, Line, Panel, Series};
use crate::{RenderError, font};
use geometry::Vector2;

/// Panels side by side under one title, with one legend for all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PanelSheet {
    /// The title.
    pub title: String,
    /// What must be known to read it, below the title.
    pub notes: Vec<String>,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels beside each other.
    pub columns: usize,
    /// Width and height of a panel, pixels.
    pub panel_size: (usize, usize),
}

/// Room at the edges, pixels.
const EDGE: f64 = 24.0;
/// Distance of lines of notes and of the legend, pixels.
const LINE_STEP: f64 = 22.0;
/// Length of a line's sample in the legend, pixels.
const SAMPLE: f64 = 34.0;

impl PanelSheet {
    /// Draws it.
    ///
    /// # Errors
    /// When the image would be too large.
    pub fn to_png(&self) -> Result<Vec<u8>, RenderError> {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns);
        let width = columns * self.panel_size.0 + 2 * EDGE as usize;
        let legend = self.legend(width as f64 - 2.0 * EDGE);
        let legend_rows = legend.last().map_or(0.0, |(at, _)| at.y / LINE_STEP + 1.0);
        let top = EDGE + TITLE + 12.0 + LINE_STEP * self.notes.len() as f64;
        let bottom = top + (rows * self.panel_size.1) as f64;
        let height = bottom + LINE_STEP * legend_rows + EDGE;
        let mut sheet = Sheet::new(width, height.ceil() as usize)?;
        let title = Vector2::new(EDGE, EDGE + TITLE);
        sheet.text(&self.title, title, TITLE * 1.25, Anchor::Left, INK);
        for (k, note) in (1..).zip(&self.notes) {
            let at = title + Vector2::new(0.0, LINE_STEP * f64::from(k) + 2.0);
            sheet.text(note, at, LABEL, Anchor::Left, [90, 98, 110]);
        }
        let size = Vector2::new(self.panel_size.0 as f64, self.panel_size.1 as f64);
        for (k, panel) in self.panels.iter().enumerate() {
            let cell = Vector2::new((k % columns) as f64, (k / columns) as f64);
            let low = Vector2::new(EDGE, top) + size.component_mul(&cell);
            panel.draw(&mut sheet, low, low + size);
        }
        for (at, series) in legend {
            draw_sample(&mut sheet, series, Vector2::new(EDGE, bottom + LABEL + 6.0) + at);
        }
        sheet.into_png()
    }

    /// The named series of all panels, each once, laid out in lines.
    fn legend(&self, width: f64) -> Vec<(Vector2<f64>, &Series)> {
        let mut placed: Vec<(Vector2<f64>, &Series)> = Vec::new();
        let mut at = Vector2::zeros();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            let known = placed.iter().any(|(_, other)| other.name == series.name);
            if series.name.is_empty() || known {
                continue;
            }
            let needed = SAMPLE + 8.0 + font::width(&series.name, LABEL);
            if at.x > 0.0 && at.x + needed > width {
                at = Vector2::new(0.0, at.y + LINE_STEP);
            }
            placed.push((at, series));
            at.x += needed + 26.0;
        }
        placed
    }
}

fn draw_sample(sheet: &mut Sheet, series: &Series, at: Vector2<f64>) {
    let [from, to] = [0.0, SAMPLE].map(|x| at + Vector2::new(x, -0.5 * LABEL));
    match series.line {
        Line::None => {}
        Line::Dashed => sheet.dashed(from, to, series.color, 1.4, 0.0),
        Line::Solid | Line::Pairs => sheet.line(from, to, series.color, 1.8),
    }
    draw_mark(sheet, series, 0.5 * (from + to));
    let text = at + Vector2::new(SAMPLE + 8.0, 0.0);
    sheet.text(&series.name, text, LABEL, Anchor::Left, INK);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::{Axis, AxisKind, Series};

    #[test]
    fn a_sheet_is_the_same_bytes_again_and_takes_any_number() {
        let bad =
            vec![(f64::NAN, 1.0), (0.5, f64::INFINITY), (0.0, -1.0), (0.2, 0.7), (9e300, 1.0)];
        let axis = |label: &str| Axis::new(label, AxisKind::Linear(0.0, 1.0));
        let mut series = Series::marked(3, "a", bad);
        series.labelled = true;
        let panel = Panel { title: "t".into(), x: axis("x"), y: axis("y"), series: vec![series] };
        let sheet = PanelSheet {
            title: "title".into(),
            notes: vec!["note".into()],
            panels: vec![panel; 3],
            columns: 2,
            panel_size: (300, 200),
        };
        let png = sheet.to_png().unwrap();
        assert!(png.starts_with(b"\x89PNG") && png == sheet.to_png().unwrap());
        let huge = PanelSheet { panel_size: (1 << 20, 1 << 20), ..sheet };
        assert!(huge.to_png().is_err());
    }
}
