use super::panel::{LABEL, TICK, TITLE};
use super::sheet::{Anchor, Sheet};
use super::{Axis, Color, INK};
use crate::RenderError;
use geometry::Vector2;

/// A table of small heat maps with the same axes, of shares from 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatSheet {
    /// The title.
    pub title: String,
    /// What must be known to read it, below the title.
    pub notes: Vec<String>,
    /// What the shares are of.
    pub scale: String,
    /// Names of the columns of maps.
    pub columns: Vec<String>,
    /// Names of the rows of maps.
    pub rows: Vec<String>,
    /// The maps, row by row; each a list of its rows of values, the lowest first.
    pub maps: Vec<Vec<Vec<f64>>>,
    /// The axis to the right of every map; its range covers whole cells.
    pub x: Axis,
    /// The axis upwards of every map.
    pub y: Axis,
}

/// Width and height of a map, and of the room it takes, pixels.
const MAP: (f64, f64) = (152.0, 152.0);
const PITCH: (f64, f64) = (176.0, 190.0);
/// Room left of and above the maps, pixels.
const LEFT: f64 = 110.0;
const EDGE: f64 = 24.0;

impl HeatSheet {
    /// Draws it.
    ///
    /// # Errors
    /// When the image would be too large.
    pub fn to_png(&self) -> Result<Vec<u8>, RenderError> {
        let top = EDGE + TITLE + 40.0 + 22.0 * self.notes.len() as f64;
        let below = top + PITCH.1 * self.rows.len() as f64;
        let width = LEFT + PITCH.0 * self.columns.len().max(4) as f64 + EDGE;
        let height = below + 74.0;
        let mut sheet = Sheet::new(width.ceil() as usize, height.ceil() as usize)?;
        let title = Vector2::new(EDGE, EDGE + TITLE);
        sheet.text(&self.title, title, TITLE * 1.25, Anchor::Left, INK);
        for (k, note) in (1..).zip(&self.notes) {
            let at = title + Vector2::new(0.0, 22.0 * f64::from(k) + 2.0);
            sheet.text(note, at, LABEL, Anchor::Left, [90, 98, 110]);
        }
        for (k, name) in self.columns.iter().enumerate() {
            let x = LEFT + PITCH.0 * k as f64 + 0.5 * MAP.0;
            sheet.text(name, Vector2::new(x, top - 10.0), LABEL, Anchor::Middle, INK);
        }
        for (row, name) in self.rows.iter().enumerate() {
            let y = top + PITCH.1 * row as f64;
            sheet.text_up(name, Vector2::new(EDGE + 10.0, y + 0.5 * MAP.1), LABEL + 1.0, INK);
            for column in 0..self.columns.len() {
                let corner = Vector2::new(LEFT + PITCH.0 * column as f64, y);
                let Some(map) = self.maps.get(row * self.columns.len() + column) else { continue };
                self.draw_map(&mut sheet, corner, map, column == 0);
            }
        }
        let foot = Vector2::new(LEFT, below + 4.0);
        sheet.text(&self.x.label, foot, LABEL, Anchor::Left, INK);
        self.draw_scale(&mut sheet, foot + Vector2::new(0.0, 24.0));
        sheet.into_png()
    }

    fn draw_map(&self, sheet: &mut Sheet, low: Vector2<f64>, map: &[Vec<f64>], first: bool) {
        let high = low + Vector2::new(MAP.0, MAP.1);
        let tall = MAP.1 / map.len().max(1) as f64;
        for (j, row) in map.iter().enumerate() {
            let wide = MAP.0 / row.len().max(1) as f64;
            for (i, &value) in row.iter().enumerate() {
                let corner = Vector2::new(low.x + wide * i as f64, high.y - tall * (j + 1) as f64);
                let far = corner + Vector2::new(wide, tall);
                // Whole pixels: half-covered ones would draw seams.
                let whole = |v: Vector2<f64>| v.map(f64::round);
                sheet.fill(whole(corner), whole(far), heat_map_color(value));
            }
        }
        sheet.frame(low, high, INK);
        for tick in self.x.ticks(MAP.0 / 50.0) {
            let x = low.x + tick.at * MAP.0;
            sheet.line(Vector2::new(x, high.y), Vector2::new(x, high.y + 4.0), INK, 1.0);
            sheet.text(&tick.label, Vector2::new(x, high.y + 17.0), TICK, Anchor::Middle, INK);
        }
        for tick in self.y.ticks(MAP.1 / 30.0).iter().filter(|_| first) {
            let y = high.y - tick.at * MAP.1;
            sheet.line(Vector2::new(low.x - 4.0, y), Vector2::new(low.x, y), INK, 1.0);
            let left = Vector2::new(low.x - 8.0, y + 0.5 * TICK);
            sheet.text(&tick.label, left, TICK, Anchor::Right, INK);
        }
        if first {
            let left = Vector2::new(low.x - 42.0, low.y + 0.5 * MAP.1);
            sheet.text_up(&self.y.label, left, TICK, INK);
        }
    }

    fn draw_scale(&self, sheet: &mut Sheet, at: Vector2<f64>) {
        for step in 0..100 {
            let x = at.x + 3.0 * f64::from(step);
            let corner = Vector2::new(x, at.y - 10.0);
            let color = heat_map_color((f64::from(step) + 0.5) / 100.0);
            sheet.fill(corner, corner + Vector2::new(3.0, 12.0), color);
        }
        sheet.frame(at + Vector2::new(0.0, -10.0), at + Vector2::new(300.0, 2.0), INK);
        for (share, label) in [(0.0, "0 %"), (0.5, "50 %"), (1.0, "100 %")] {
            let below = at + Vector2::new(300.0 * share, 19.0);
            sheet.text(label, below, TICK, Anchor::Middle, INK);
        }
        sheet.text(&self.scale, at + Vector2::new(335.0, 0.0), LABEL, Anchor::Left, INK);
    }
}

/// The colour of a share from 0 (dark violet) to 1 (yellow): nine samples of the map viridis, by
/// lightness alone readable; grey for what is no number.
pub fn heat_map_color(share: f64) -> Color {
    const SAMPLES: [Color; 9] = [
        [68, 1, 84],
        [71, 44, 122],
        [59, 81, 139],
        [44, 113, 142],
        [33, 144, 141],
        [39, 173, 129],
        [92, 200, 99],
        [170, 220, 50],
        [253, 231, 37],
    ];
    if share.is_nan() {
        return [190, 190, 190];
    }
    let at = share.clamp(0.0, 1.0) * (SAMPLES.len() - 1) as f64;
    let below = (at.floor() as usize).min(SAMPLES.len() - 2);
    let rest = at - below as f64;
    std::array::from_fn(|k| {
        let [a, b] = [below, below + 1].map(|sample| f64::from(SAMPLES[sample][k]));
        (a + (b - a) * rest).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_get_lighter() {
        let light = |share: f64| heat_map_color(share).map(u32::from).iter().sum::<u32>();
        assert!((0..10).all(|k| light(f64::from(k) / 10.0) < light(f64::from(k + 1) / 10.0)));
        assert_eq!(heat_map_color(7.0), heat_map_color(1.0));
    }
}
