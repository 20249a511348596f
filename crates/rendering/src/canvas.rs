use crate::contour::distance_to_segment;
use crate::palette::{self, Ink, LEVELS};
use crate::{Cell, RenderError, font};
use geometry::Vector2;

/// An image of palette indices that anti-aliased lines are drawn on. Pixel (0, 0) is at the top
/// left; pixel `(i, j)` covers `i..i+1`, `j..j+1`.
pub(crate) struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    /// Rows below this are out of bounds for drawing.
    clip: usize,
}

/// How a line is drawn.
#[derive(Clone, Copy)]
pub(crate) struct Pen {
    pub ink: Ink,
    /// Width in pixels.
    pub width: f64,
}

impl Canvas {
    /// An empty sheet of paper.
    pub fn new(width: usize, height: usize) -> Self {
        let pixels = vec![palette::base(Cell::Free); width * height];
        Canvas { width, height, pixels, clip: height }
    }

    /// Columns of pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Puts another sheet on this one with its upper left corner at a pixel; it must fit.
    pub fn paste(&mut self, other: &Canvas, left: usize, top: usize) {
        for (row, pixels) in other.pixels.chunks_exact(other.width.max(1)).enumerate() {
            self.row_mut(top + row)[left..left + pixels.len()].copy_from_slice(pixels);
        }
    }

    /// Restricts drawing to the rows above `rows`.
    pub fn clip_rows(&mut self, rows: usize) {
        self.clip = rows.min(self.height);
    }

    /// One row of pixels to fill.
    pub fn row_mut(&mut self, row: usize) -> &mut [u8] {
        &mut self.pixels[row * self.width..(row + 1) * self.width]
    }

    /// A line through points.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = Vector2<f64>>, pen: Pen) {
        let mut points = points.into_iter().filter(|p| p.iter().all(|v| v.is_finite()));
        let Some(mut last) = points.next() else { return };
        let mut pending = None;
        for point in points {
            // Poses a fraction of a pixel apart would only repeat the same pixels.
            if (point - last).norm_squared() < 0.25 {
                pending = Some(point);
            } else {
                self.line(last, point, pen);
                (last, pending) = (point, None);
            }
        }
        if let Some(point) = pending {
            self.line(last, point, pen);
        }
    }

    /// A line with round ends.
    pub fn line(&mut self, a: Vector2<f64>, b: Vector2<f64>, pen: Pen) {
        let reach = 0.5 * pen.width.max(0.0) + 1.0;
        let low = Vector2::repeat(-reach);
        let high = Vector2::new(self.width as f64, self.clip as f64).add_scalar(reach);
        let Some((a, b)) = clip_segment(a, b, low, high) else { return };
        let d = b - a;
        let (major, minor) = if d.x.abs() >= d.y.abs() { (0, 1) } else { (1, 0) };
        let slope = if d[major] == 0.0 { 0.0 } else { d[minor] / d[major] };
        let (from, to) = (a[major].min(b[major]), a[major].max(b[major]));
        let limit = Vector2::new(self.width, self.clip);
        // At 45 degrees a line of width w measures w * sqrt(2) along the minor axis.
        let spread = 1.5 * reach;
        for i in pixel_range(from - reach, to + reach, limit[major]) {
            let along = (i as f64 + 0.5).clamp(from, to) - a[major];
            let middle = a[minor] + along * slope;
            for j in pixel_range(middle - spread, middle + spread, limit[minor]) {
                let (x, y) = if major == 0 { (i, j) } else { (j, i) };
                let center = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
                self.cover(
                    x,
                    y,
                    pen.ink,
                    0.5 * pen.width + 0.5 - distance_to_segment(center, a, b),
                );
            }
        }
    }

    /// A dashed line; dashes and gaps are `dash` pixels long.
    pub fn dashed(&mut self, a: Vector2<f64>, b: Vector2<f64>, dash: f64, pen: Pen) {
        let high = Vector2::new(self.width as f64, self.clip as f64);
        let Some((a, b)) = clip_segment(a, b, Vector2::zeros(), high) else { return };
        let length = (b - a).norm();
        let dash = dash.max(1.0);
        for k in 0..(length / (2.0 * dash)).ceil() as usize {
            let at = |s: f64| a + (b - a) * (s.min(length) / length);
            let start = 2.0 * dash * k as f64;
            self.line(at(start), at(start + dash), pen);
        }
    }

    /// A filled circle.
    pub fn disc(&mut self, center: Vector2<f64>, radius: f64, ink: Ink) {
        self.line(center, center, Pen { ink, width: 2.0 * radius });
    }

    /// A filled triangle.
    pub fn triangle(&mut self, corners: [Vector2<f64>; 3], ink: Ink) {
        let [a, b, c] = corners;
        let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        let turn = (b - a).perp(&(c - a)).signum();
        for y in pixel_range(low.y - 1.0, high.y + 1.0, self.clip) {
            for x in pixel_range(low.x - 1.0, high.x + 1.0, self.width) {
                let p = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
                let inside = |u: Vector2<f64>, v: Vector2<f64>| {
                    turn * (v - u).perp(&(p - u)) / (v - u).norm().max(1e-9)
                };
                self.cover(x, y, ink, 0.5 + inside(a, b).min(inside(b, c)).min(inside(c, a)));
            }
        }
    }

    /// Text with the left end of its base line at `at`; `size` is the height of capitals in pixels.
    pub fn text(&mut self, text: &str, at: Vector2<f64>, size: f64, ink: Ink) {
        let unit = size / font::CAP_HEIGHT;
        let pen = Pen { ink, width: (0.16 * size).max(1.0) };
        for (stroke, column) in font::strokes(text) {
            let place = |(x, y): (f64, f64)| at + Vector2::new(column + x, -y) * unit;
            match stroke.as_slice() {
                [dot] => self.disc(place(*dot), 0.6 * pen.width, ink),
                _ => stroke.windows(2).for_each(|w| self.line(place(w[0]), place(w[1]), pen)),
            }
        }
    }

    /// The image as an indexed PNG.
    pub fn into_png(self) -> Result<Vec<u8>, RenderError> {
        let refused = |e: png::EncodingError| RenderError::Encode(e.to_string());
        let side = |n: usize| u32::try_from(n).map_err(|e| RenderError::Encode(e.to_string()));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side(self.width)?, side(self.height)?);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(palette::palette());
        encoder.set_compression(png::Compression::Fast);
        encoder.set_filter(png::Filter::Up);
        let mut writer = encoder.write_header().map_err(refused)?;
        writer.write_image_data(&self.pixels).map_err(refused)?;
        writer.finish().map_err(refused)?;
        Ok(bytes)
    }

    fn cover(&mut self, x: usize, y: usize, ink: Ink, coverage: f64) {
        let level = (coverage.clamp(0.0, 1.0) * LEVELS as f64).round() as usize;
        let pixel = &mut self.pixels[y * self.width + x];
        *pixel = palette::over(*pixel, ink, level);
    }
}

/// Pixels whose centres may lie between `from` and `to`.
fn pixel_range(from: f64, to: f64, limit: usize) -> std::ops::Range<usize> {
    let inside = |v: f64| v.clamp(0.0, limit as f64);
    inside(from.floor()) as usize..inside(to.ceil()) as usize
}

/// The part of a segment inside a box (Liang and Barsky 1984), if there is any.
pub(crate) fn clip_segment(
    a: Vector2<f64>,
    b: Vector2<f64>,
    low: Vector2<f64>,
    high: Vector2<f64>,
) -> Option<(Vector2<f64>, Vector2<f64>)> {
    let d = b - a;
    if !(a + d).iter().chain(d.iter()).all(|v| v.is_finite()) {
        return None;
    }
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        if d[k] == 0.0 {
            if a[k] < low[k] || a[k] > high[k] {
                return None;
            }
            continue;
        }
        let (t, u) = ((low[k] - a[k]) / d[k], (high[k] - a[k]) / d[k]);
        enter = enter.max(t.min(u));
        leave = leave.min(t.max(u));
    }
    (enter <= leave).then(|| (a + d * enter, a + d * leave))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vector2<f64>> {
        (-300.0..300.0_f64, -300.0..300.0_f64).prop_map(|(x, y)| Vector2::new(x, y))
    }

    proptest! {
        /// Of finely spaced points along a segment, exactly those in the box are on the clipped
        /// piece.
        #[test]
        fn clipping_keeps_what_is_inside(a in point(), b in point(), low in point(), size in point()) {
            let high = low + size.abs();
            let clipped = clip_segment(a, b, low, high);
            for k in 0..=200 {
                let p = a + (b - a) * (f64::from(k) / 200.0);
                let margin = (p - low).min().min((high - p).min());
                let kept = clipped.is_some_and(|(u, v)| distance_to_segment(p, u, v) < 1e-9);
                // Points within rounding of the box's border may fall on either side.
                prop_assert!(margin.abs() < 1e-9 || kept == (margin > 0.0), "{p:?} {clipped:?}");
            }
        }

        /// Lines paint what is within half their width, and nothing a pixel beyond; clipped or not.
        #[test]
        fn lines_are_as_wide_as_they_say(a in point(), b in point(), width in 1.0..9.0_f64) {
            let mut canvas = Canvas::new(80, 60);
            canvas.line(a, b, Pen { ink: Ink::Accepted, width });
            for y in 0..60 {
                for x in 0..80 {
                    let center = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let distance = distance_to_segment(center, a, b);
                    let painted = canvas.pixels[y * 80 + x] != palette::base(Cell::Free);
                    prop_assert!(painted || distance > 0.5 * width);
                    prop_assert!(!painted || distance < 0.5 * width + 0.5);
                }
            }
        }
    }

    #[test]
    fn lines_that_are_not_finite_are_not_drawn() {
        let mut canvas = Canvas::new(8, 8);
        let pen = Pen { ink: Ink::Text, width: 2.0 };
        for bad in [f64::NAN, f64::INFINITY, 1e308, -1e308] {
            canvas.line(Vector2::new(bad, 0.0), Vector2::new(-bad, 4.0), pen);
            canvas.dashed(Vector2::new(bad, 0.0), Vector2::new(4.0, bad), 2.0, pen);
        }
        assert!(canvas.pixels.iter().all(|p| *p == palette::base(Cell::Free)));
    }
}
