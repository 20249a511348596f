use super::Color;
use crate::canvas::clip_segment;
use crate::contour::distance_to_segment;
use crate::{RenderError, font};
use geometry::Vector2;

/// White paper in full colour, with anti-aliased lines and text. Pixel (0, 0) is at the top left.
pub(super) struct Sheet {
    width: usize,
    height: usize,
    pixels: Vec<Color>,
}

/// Where text stands to its point on the base line.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

impl Sheet {
    /// More pixels than this are refused.
    const MAX_PIXELS: usize = 100_000_000;

    pub fn new(width: usize, height: usize) -> Result<Self, RenderError> {
        if width.saturating_mul(height) > Self::MAX_PIXELS {
            return Err(RenderError::Encode(format!("a plot of {width} x {height} pixels")));
        }
        Ok(Sheet { width, height, pixels: vec![[255; 3]; width * height] })
    }

    /// A straight line with round ends.
    pub fn line(&mut self, a: Vector2<f64>, b: Vector2<f64>, color: Color, width: f64) {
        let reach = 0.5 * width + 1.0;
        let size = Vector2::new(self.width as f64, self.height as f64);
        let Some((a, b)) = clip_segment(a, b, Vector2::repeat(-reach), size.add_scalar(reach))
        else {
            return;
        };
        let (low, high) = (a.inf(&b).add_scalar(-reach), a.sup(&b).add_scalar(reach));
        self.paint(low, high, color, |p| 0.5 * width + 0.5 - distance_to_segment(p, a, b));
    }

    /// A dashed line; `along` is the length drawn so far, so that dashes go on around corners.
    pub fn dashed(
        &mut self,
        a: Vector2<f64>,
        b: Vector2<f64>,
        color: Color,
        width: f64,
        along: f64,
    ) {
        const DASH: f64 = 5.0;
        let length = (b - a).norm();
        if !length.is_finite() || length == 0.0 {
            return;
        }
        let first = (along / (2.0 * DASH)).floor() as i64;
        let last = ((along + length) / (2.0 * DASH)).ceil() as i64;
        for k in first..last {
            let start = (2.0 * DASH * k as f64 - along).max(0.0);
            let end = (2.0 * DASH * k as f64 + DASH - along).min(length);
            if start < end {
                self.line(
                    a + (b - a) * (start / length),
                    a + (b - a) * (end / length),
                    color,
                    width,
                );
            }
        }
    }

    /// A filled circle.
    pub fn disc(&mut self, at: Vector2<f64>, radius: f64, color: Color) {
        self.around(at, radius, color, |p| radius + 0.5 - (p - at).norm());
    }

    /// A circle's line.
    pub fn ring(&mut self, at: Vector2<f64>, radius: f64, color: Color, width: f64) {
        self.around(at, radius + width, color, |p| {
            0.5 * width + 0.5 - ((p - at).norm() - radius).abs()
        });
    }

    /// A filled square, on its side or on its tip.
    pub fn square(&mut self, at: Vector2<f64>, radius: f64, tipped: bool, color: Color) {
        self.around(at, 1.5 * radius, color, |p| {
            let d = (p - at).abs();
            let far = if tipped { (d.x + d.y) * 0.75 } else { d.x.max(d.y) };
            radius + 0.5 - far
        });
    }

    /// A filled rectangle between two corners.
    pub fn fill(&mut self, low: Vector2<f64>, high: Vector2<f64>, color: Color) {
        self.paint(low, high, color, |p| (p - low).min().min((high - p).min()) + 0.5);
    }

    /// A rectangle's outline.
    pub fn frame(&mut self, low: Vector2<f64>, high: Vector2<f64>, color: Color) {
        let [b, d] = [Vector2::new(high.x, low.y), Vector2::new(low.x, high.y)];
        for (from, to) in [(low, b), (b, high), (high, d), (d, low)] {
            self.line(from, to, color, 1.2);
        }
    }

    /// Text on a base line; `size` is the height of capitals in pixels.
    pub fn text(&mut self, text: &str, at: Vector2<f64>, size: f64, anchor: Anchor, color: Color) {
        self.turned_text(text, at, size, anchor, color, |v| v);
    }

    /// Text that reads upwards, its base line through `at`.
    pub fn text_up(&mut self, text: &str, at: Vector2<f64>, size: f64, color: Color) {
        self.turned_text(text, at, size, Anchor::Middle, color, |v| Vector2::new(v.y, -v.x));
    }

    fn turned_text(
        &mut self,
        text: &str,
        at: Vector2<f64>,
        size: f64,
        anchor: Anchor,
        color: Color,
        turn: impl Fn(Vector2<f64>) -> Vector2<f64>,
    ) {
        let unit = size / font::CAP_HEIGHT;
        let width = (0.14 * size).max(1.0);
        let share = [0.0, 0.5, 1.0][anchor as usize];
        let left = -share * font::width(text, size);
        for (stroke, column) in font::strokes(text) {
            let place =
                |(x, y): (f64, f64)| at + turn(Vector2::new(left + (column + x) * unit, -y * unit));
            match stroke.as_slice() {
                [dot] => self.disc(place(*dot), 0.7 * width, color),
                _ => stroke
                    .windows(2)
                    .for_each(|w| self.line(place(w[0]), place(w[1]), color, width)),
            }
        }
    }

    /// The image as a PNG in full colour.
    pub fn into_png(self) -> Result<Vec<u8>, RenderError> {
        let refused = |e: png::EncodingError| RenderError::Encode(e.to_string());
        let side = |n: usize| u32::try_from(n).map_err(|e| RenderError::Encode(e.to_string()));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side(self.width)?, side(self.height)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(refused)?;
        writer.write_image_data(self.pixels.as_flattened()).map_err(refused)?;
        writer.finish().map_err(refused)?;
        Ok(bytes)
    }

    fn around(
        &mut self,
        at: Vector2<f64>,
        reach: f64,
        color: Color,
        coverage: impl Fn(Vector2<f64>) -> f64,
    ) {
        let reach = reach + 1.0;
        self.paint(at.add_scalar(-reach), at.add_scalar(reach), color, coverage);
    }

    /// Blends a colour into the pixels of a box by how far each is covered.
    fn paint(
        &mut self,
        low: Vector2<f64>,
        high: Vector2<f64>,
        color: Color,
        coverage: impl Fn(Vector2<f64>) -> f64,
    ) {
        let clip = |v: f64, limit: usize| v.clamp(0.0, limit as f64) as usize;
        // A NaN corner clamps to NaN and casts to zero: nothing is drawn.
        let (x0, x1) = (clip(low.x.floor(), self.width), clip(high.x.ceil(), self.width));
        for y in clip(low.y.floor(), self.height)..clip(high.y.ceil(), self.height) {
            for x in x0..x1 {
                let share = coverage(Vector2::new(x as f64 + 0.5, y as f64 + 0.5)).clamp(0.0, 1.0);
                let pixel = &mut self.pixels[y * self.width + x];
                for (below, above) in pixel.iter_mut().zip(color) {
                    let mixed = f64::from(*below) * (1.0 - share) + f64::from(above) * share;
                    *below = mixed.round() as u8;
                }
            }
        }
    }
}
