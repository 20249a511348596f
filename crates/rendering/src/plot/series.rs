use super::Color;

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend; without one it is not named there.
    pub name: String,
    /// Its colour.
    pub color: Color,
    /// Values along x and y.
    pub points: Vec<(f64, f64)>,
    /// The line through them.
    pub line: Line,
    /// The mark at each.
    pub mark: Mark,
    /// Write the name beside the first point.
    pub labelled: bool,
}

/// How the points of a series are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Not at all.
    None,
    /// One after the other.
    Solid,
    /// One after the other, by dashes.
    Dashed,
    /// The first with the second, the third with the fourth.
    Pairs,
}

/// How the points of a series are marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Not at all.
    None,
    /// By the smallest dot.
    Speck,
    /// By a small dot.
    Dot,
    /// By a disc.
    Disc,
    /// By a ring.
    Ring,
    /// By a square.
    Square,
    /// By a square on its tip.
    Diamond,
}

impl Series {
    /// A line with marks: discs, then squares, then diamonds, as colours begin to look alike.
    pub fn marked(index: usize, name: &str, points: Vec<(f64, f64)>) -> Self {
        let mark = [Mark::Disc, Mark::Square, Mark::Diamond][index % 3];
        let color = super::series_color(index);
        Series { name: name.into(), color, points, line: Line::Solid, mark, labelled: false }
    }

    /// A dashed line with rings: the figures of others.
    pub fn foreign(color: Color, name: &str, points: Vec<(f64, f64)>) -> Self {
        let (line, mark) = (Line::Dashed, Mark::Ring);
        Series { name: name.into(), color, points, line, mark, labelled: false }
    }

    /// Unnamed lines between pairs of points.
    pub fn pairs(color: Color, points: Vec<(f64, f64)>) -> Self {
        let name = String::new();
        Series { name, color, points, line: Line::Pairs, mark: Mark::None, labelled: false }
    }

    /// Dots alone.
    pub fn dots(color: Color, name: &str, points: Vec<(f64, f64)>) -> Self {
        let (line, mark) = (Line::None, Mark::Dot);
        Series { name: name.into(), color, points, line, mark, labelled: false }
    }
}
