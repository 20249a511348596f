use crate::palette::Ink;
use crate::svg::{hex, overlay_svg, stroke_width, view_box};
use crate::text::{base64, escape};
use crate::{Annotations, MarkKind, OccupancyGrid, RenderError, map_png};
use serde_json::Value;
use std::fmt::Write;

/// A run's report: one HTML file with everything in it, for a browser without network.
#[derive(Clone, Debug, Default)]
pub struct Report {
    title: String,
    body: String,
}

/// Style of the report, for light and dark screens and for paper.
const STYLE: &str = include_str!("report.css");
/// Deepest nesting of values that is shown; deeper ones are named only.
const MAX_DEPTH: usize = 8;

impl Report {
    /// An empty report.
    pub fn new(title: &str) -> Self {
        Report { title: title.to_owned(), body: String::new() }
    }

    /// A section heading.
    pub fn heading(&mut self, text: &str) -> &mut Self {
        self.push("h2", text)
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        self.push("p", text)
    }

    /// The map with paths and closures drawn over it, and check boxes to hide them.
    ///
    /// # Errors
    /// As [`map_png`].
    pub fn map(
        &mut self,
        grid: &OccupancyGrid,
        annotations: &Annotations,
    ) -> Result<&mut Self, RenderError> {
        let bare = Annotations {
            scale_bar: false,
            legend: false,
            zoom: Some(1),
            ..Annotations::default()
        };
        let png = base64(&map_png(grid, &bare)?);
        let frame = grid.frame();
        let size = frame.upper_right() - frame.origin;
        let overlay = overlay_svg(annotations, 0.5 * frame.resolution_m, stroke_width(frame));
        let _ = write!(
            self.body,
            "<figure>{}\n<svg class=\"map\" xmlns=\"http://www.w3.org/2000/svg\" \
             viewBox=\"{}\" role=\"img\" aria-label=\"map\">\n\
             <image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" \
             href=\"data:image/png;base64,{png}\"/>\n{overlay}</svg>\n\
             <figcaption>{:.1} m \u{d7} {:.1} m, {} cm per cell.</figcaption></figure>\n",
            layers(annotations),
            view_box(frame),
            frame.origin.x,
            -frame.upper_right().y,
            size.x,
            size.y,
            size.x,
            size.y,
            (frame.resolution_m * 1e5).round() / 1e3,
        );
        Ok(self)
    }

    /// A table with a heading row. Rows may be of any length.
    pub fn table(&mut self, header: &[&str], rows: &[Vec<String>]) -> &mut Self {
        self.body.push_str("<div class=\"wide\"><table><thead><tr>");
        header.iter().for_each(|h| self.cell("th", h));
        self.body.push_str("</tr></thead><tbody>\n");
        for row in rows {
            self.body.push_str("<tr>");
            row.iter().for_each(|text| self.cell("td", text));
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table></div>\n");
        self
    }

    /// A tree of values, such as a run's metrics: objects become tables of two columns, lists of
    /// objects tables with a heading row.
    pub fn values(&mut self, value: &Value) -> &mut Self {
        self.value(value, 0);
        self.body.push('\n');
        self
    }

    /// The whole file.
    pub fn to_html(&self) -> String {
        let title = escape(&self.title);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta http-equiv=\"Content-Security-Policy\" \
             content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style></head>\n<body><main>\n\
             <h1>{title}</h1>\n{}</main></body></html>\n",
            self.body
        )
    }

    fn push(&mut self, tag: &str, text: &str) -> &mut Self {
        self.cell(tag, text);
        self.body.push('\n');
        self
    }

    fn cell(&mut self, tag: &str, text: &str) {
        let number = tag == "td" && text.trim_end_matches('%').trim().parse::<f64>().is_ok();
        let class = if number { " class=\"number\"" } else { "" };
        let _ = write!(self.body, "<{tag}{class}>{}</{tag}>", escape(text));
    }

    fn value(&mut self, value: &Value, depth: usize) {
        match value {
            Value::Object(_) | Value::Array(_) if depth >= MAX_DEPTH => self.body.push('\u{2026}'),
            Value::Object(fields) => {
                self.body.push_str("<table class=\"values\">");
                for (name, value) in fields {
                    self.body.push_str("<tr>");
                    self.cell("th", &label(name));
                    self.value_cell(value, depth);
                    self.body.push_str("</tr>\n");
                }
                self.body.push_str("</table>");
            }
            Value::Array(items) if items.iter().all(Value::is_object) && !items.is_empty() => {
                self.objects(items, depth);
            }
            Value::Array(items) => {
                for (k, item) in items.iter().enumerate() {
                    self.body.push_str(if k > 0 { ", " } else { "" });
                    self.value(item, depth + 1);
                }
            }
            scalar => self.body.push_str(&escape(&plain(scalar))),
        }
    }

    /// Rows for a list of objects; columns in the order in which they first occur.
    fn objects(&mut self, items: &[Value], depth: usize) {
        let mut columns: Vec<&String> = Vec::new();
        for name in items.iter().filter_map(Value::as_object).flat_map(|fields| fields.keys()) {
            if !columns.contains(&name) {
                columns.push(name);
            }
        }
        self.body.push_str("<table><thead><tr>");
        columns.iter().for_each(|name| self.cell("th", &label(name)));
        self.body.push_str("</tr></thead><tbody>\n");
        for item in items {
            self.body.push_str("<tr>");
            for name in &columns {
                self.value_cell(item.get(name.as_str()).unwrap_or(&Value::Null), depth);
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table>");
    }

    fn value_cell(&mut self, value: &Value, depth: usize) {
        if value.is_object() || value.is_array() {
            self.body.push_str("<td>");
            self.value(value, depth + 1);
            self.body.push_str("</td>");
        } else {
            self.cell("td", &plain(value));
        }
    }
}

/// The boxes that hide layers, without script: the style sheet looks at whether they are checked.
fn layers(annotations: &Annotations) -> String {
    let mut html = String::new();
    let mut layer = |present: bool, class: &str, ink: Ink, name: &str| {
        if present {
            let color = hex(ink);
            let _ = write!(
                html,
                "<label class=\"layer {class}\"><input type=\"checkbox\" checked> \
                 <span style=\"background:{color}\"></span>{}</label>",
                escape(name)
            );
        }
    };
    let robots: Vec<_> =
        annotations.trajectories.iter().enumerate().filter(|(_, t)| !t.poses.is_empty()).collect();
    let paths = robots.iter().map(|(_, t)| t.name).collect::<Vec<_>>().join(", ");
    let first = robots.first().map_or(0, |(k, _)| *k);
    layer(!robots.is_empty(), "paths", Ink::Robot(first), &format!("paths: {paths}"));
    layer(!annotations.patches.is_empty(), "patches", Ink::Patch, "patches");
    for kind in MarkKind::ALL {
        let count = annotations.closures.iter().filter(|c| c.kind == kind).count();
        let text = format!("{}: {count}", kind.name());
        layer(count > 0, kind.class(), kind.style().ink, &text);
    }
    html
}

/// A field's name as people write it: `duration_secs` becomes `duration, s`.
fn label(name: &str) -> String {
    let units = [
        ("_m", "m"),
        ("_rad", "rad"),
        ("_deg", "\u{b0}"),
        ("_secs", "s"),
        ("_hz", "Hz"),
        ("_mib", "MiB"),
    ];
    let unit = units.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, unit)));
    match unit {
        Some((quantity, unit)) => format!("{}, {unit}", quantity.replace('_', " ")),
        None => name.replace('_', " "),
    }
}

/// A scalar as people write it; figures are cut to six digits.
fn plain(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Value::Number(n) if n.is_f64() => n.as_f64().map(six_digits).unwrap_or_default(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn six_digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (5.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
