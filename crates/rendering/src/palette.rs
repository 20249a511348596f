use crate::Cell;

/// A colour that annotations are drawn in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ink {
    Text,
    Paper,
    Accepted,
    Rejected,
    Patch,
    Robot(usize),
}

pub(crate) type Rgb = [u8; 3];

/// Backgrounds, in the order of the palette.
const BASES: [Rgb; 3] = [[198, 211, 226], [255, 255, 255], [0, 0, 0]];
/// Inks, in the order of the palette; robots last.
const INKS: [Rgb; 12] = [
    [34, 40, 49],
    [255, 255, 255],
    [0, 145, 70],
    [222, 40, 40],
    [120, 130, 150],
    [0, 95, 215],
    [235, 120, 0],
    [140, 60, 200],
    [0, 150, 160],
    [225, 50, 140],
    [140, 85, 45],
    [110, 130, 0],
];
const FIRST_ROBOT: usize = 5;
/// Steps of coverage along an anti-aliased border.
pub(crate) const LEVELS: usize = 7;

impl Ink {
    /// How many robots get a colour of their own; later ones repeat them.
    pub const ROBOTS: usize = INKS.len() - FIRST_ROBOT;

    fn index(self) -> usize {
        match self {
            Ink::Text => 0,
            Ink::Paper => 1,
            Ink::Accepted => 2,
            Ink::Rejected => 3,
            Ink::Patch => 4,
            Ink::Robot(k) => FIRST_ROBOT + k % Self::ROBOTS,
        }
    }

    pub fn rgb(self) -> Rgb {
        INKS[self.index()]
    }
}

/// The palette index of a bare cell.
pub(crate) fn base(cell: Cell) -> u8 {
    match cell {
        Cell::Unknown => 0,
        Cell::Free => 1,
        Cell::Occupied => 2,
    }
}

/// `pixel` with `ink` over it; `level` of [`LEVELS`] of the pixel is covered.
///
/// The background below stays known, so that drawing needs one byte per pixel: 3 bare colours and
/// 12 inks x 7 levels x 3 backgrounds make 255. The stronger of two inks wins a pixel.
pub(crate) fn over(pixel: u8, ink: Ink, level: usize) -> u8 {
    let level = level.min(LEVELS);
    let (background, old) = split(pixel);
    let keep = match old {
        _ if level == 0 => true,
        Some((index, strength)) if index == ink.index() => strength >= level,
        Some((_, strength)) => level <= LEVELS / 2 && level <= strength,
        None => false,
    };
    if keep { pixel } else { (3 + (ink.index() * LEVELS + level - 1) * 3) as u8 + background }
}

fn split(pixel: u8) -> (u8, Option<(usize, usize)>) {
    match pixel.checked_sub(3) {
        None => (pixel, None),
        Some(rest) => {
            let step = usize::from(rest / 3);
            (rest % 3, Some((step / LEVELS, step % LEVELS + 1)))
        }
    }
}

/// The colours of all 255 indices.
pub(crate) fn palette() -> Vec<u8> {
    let mix = |pixel: u8| {
        let (background, ink) = split(pixel);
        let below = BASES[usize::from(background)];
        let (above, level) = ink.map_or((below, 0), |(index, level)| (INKS[index], level));
        std::array::from_fn::<u8, 3, _>(|k| {
            let (a, b) = (usize::from(above[k]), usize::from(below[k]));
            ((a * level + b * (LEVELS - level) + LEVELS / 2) / LEVELS) as u8
        })
    };
    (0..255_u8).flat_map(mix).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_ink_hides_every_background_and_keeps_it() {
        let colors = palette();
        for cell in [Cell::Unknown, Cell::Free, Cell::Occupied] {
            for robot in 0..Ink::ROBOTS {
                let ink = Ink::Robot(robot);
                let pixel = over(base(cell), ink, LEVELS);
                assert_eq!(colors[usize::from(pixel) * 3..][..3], ink.rgb());
                assert_eq!(split(pixel).0, base(cell));
            }
        }
    }

    #[test]
    fn ink_grows_and_never_fades() {
        let mut pixel = base(Cell::Occupied);
        for level in [2, 5, 3, 7, 1] {
            let before = split(pixel).1.map_or(0, |(_, strength)| strength);
            pixel = over(pixel, Ink::Accepted, level);
            assert_eq!(split(pixel).1, Some((Ink::Accepted.index(), before.max(level))));
        }
    }
}
