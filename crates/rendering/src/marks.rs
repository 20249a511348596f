use crate::canvas::Canvas;
use crate::map_image::Scale;
use crate::palette::Ink;
use geometry::Vector2;

/// A relation to draw: a line between two places of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosureMark {
    /// One patch, in the map frame, metres.
    pub from: Vector2<f64>,
    /// The other patch, in the map frame, metres.
    pub to: Vector2<f64>,
    /// What joins them.
    pub kind: MarkKind,
}

/// What a line between two patches stands for. Later ones are drawn over earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MarkKind {
    /// A relation that was taken back.
    Rejected,
    /// A relation on record whose evidence is not enough yet.
    Provisional,
    /// A loop closed by geometry.
    Closure,
    /// Both ends see the same landmarks.
    Landmark,
    /// Islands joined by geometry.
    Merge,
    /// One robot saw the other.
    Rendezvous,
    /// Where a landmark is; both ends are there.
    Sighted,
}

impl MarkKind {
    /// All kinds, in the order in which they are drawn.
    pub const ALL: [MarkKind; 7] = [
        MarkKind::Rejected,
        MarkKind::Provisional,
        MarkKind::Closure,
        MarkKind::Landmark,
        MarkKind::Merge,
        MarkKind::Rendezvous,
        MarkKind::Sighted,
    ];

    /// What the legend calls it.
    pub fn name(self) -> &'static str {
        match self {
            MarkKind::Rejected => "rejected closure",
            MarkKind::Provisional => "provisional",
            MarkKind::Closure => "loop closure",
            MarkKind::Landmark => "landmark closure",
            MarkKind::Merge => "merge",
            MarkKind::Rendezvous => "rendezvous",
            MarkKind::Sighted => "landmark",
        }
    }

    /// Its class in SVG drawings and reports.
    pub(crate) fn class(self) -> &'static str {
        match self {
            MarkKind::Rejected => "rejected",
            MarkKind::Provisional => "provisional",
            MarkKind::Closure => "accepted",
            MarkKind::Landmark => "landmark",
            MarkKind::Merge => "merge",
            MarkKind::Rendezvous => "rendezvous",
            MarkKind::Sighted => "sighted",
        }
    }

    pub(crate) fn style(self) -> MarkStyle {
        let thin = |ink| MarkStyle { ink, width: 1.3, dashed: false, cased: false, ends: false };
        let cased = MarkStyle { width: 2.0, cased: true, ends: true, ..thin(Ink::Text) };
        match self {
            MarkKind::Rejected => MarkStyle { width: 1.1, dashed: true, ..thin(Ink::Rejected) },
            MarkKind::Provisional => MarkStyle { dashed: true, ..thin(Ink::Patch) },
            MarkKind::Closure => thin(Ink::Accepted),
            MarkKind::Landmark => MarkStyle { ends: true, ..thin(Ink::Accepted) },
            MarkKind::Merge => cased,
            MarkKind::Rendezvous => MarkStyle { dashed: true, ..cased },
            MarkKind::Sighted => MarkStyle { ink: Ink::Accepted, ..cased },
        }
    }
}

/// How a mark is drawn. The palette of images has no colour to spare for every kind; strokes and
/// ends tell them apart, which also serves those who do not see colours.
#[derive(Clone, Copy)]
pub(crate) struct MarkStyle {
    pub ink: Ink,
    /// Width of the line; 1 is a pixel of a page.
    pub width: f64,
    pub dashed: bool,
    /// With a white border, to stand out from walls.
    pub cased: bool,
    /// With a disc at both ends.
    pub ends: bool,
}

impl MarkStyle {
    /// Length of dashes, in the same unit as the width.
    pub const DASH: f64 = 5.0;
    /// Radius of the discs at the ends.
    pub const END: f64 = 3.2;
    /// Width of the white border on either side.
    pub const CASE: f64 = 1.3;

    /// Draws a mark between two pixels, `widen` times as wide.
    pub fn draw(
        &self,
        canvas: &mut Canvas,
        (from, to): (Vector2<f64>, Vector2<f64>),
        scale: Scale,
        widen: f64,
    ) {
        let width = widen * self.width;
        if self.cased {
            canvas.line(from, to, scale.pen(Ink::Paper, width + 2.0 * Self::CASE));
            for end in [from, to] {
                canvas.disc(end, (Self::END + Self::CASE) * scale.unit, Ink::Paper);
            }
        }
        let pen = scale.pen(self.ink, width);
        if self.dashed {
            canvas.dashed(from, to, Self::DASH * scale.unit, pen);
        } else {
            canvas.line(from, to, pen);
        }
        if self.ends {
            for end in [from, to] {
                canvas.disc(end, Self::END * scale.unit, self.ink);
            }
        }
    }
}

/// The marks in the order in which they are drawn.
pub(crate) fn in_drawing_order(marks: &[ClosureMark]) -> impl Iterator<Item = &ClosureMark> {
    let of_kind = move |kind| marks.iter().filter(move |mark| mark.kind == kind);
    MarkKind::ALL.into_iter().flat_map(of_kind)
}
