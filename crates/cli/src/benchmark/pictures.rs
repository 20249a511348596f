use super::Comparison;
use super::situations::{Place, SituationResult};
use super::thesis::{BASE, ROWS, ThesisRow};
use geometry::{Pose2, Vector2};
use matching::protocol::CELL_NAMES;
use rendering::RenderError;
use rendering::plot::{Axis, AxisKind, Color, Line, Mark, Panel, PanelSheet, Series};

/// Errors below this are drawn at the border, metres.
const LEAST_M: f64 = 1e-4;
const REFERENCE: Color = [31, 119, 180];
const SCAN: Color = [220, 60, 20];
const WALLS: Color = [176, 184, 196];
/// The thesis's rows, in the order of [`ROWS`].
const THESIS: [Color; 4] = [[190, 120, 190], [190, 140, 60], [60, 140, 120], [0, 0, 0]];
const GUESS: Color = [150, 155, 165];

/// The places seen from above, with both scans where they truly lie.
pub fn scans(places: &[Place]) -> Result<Vec<u8>, RenderError> {
    let size = (760.0, 600.0);
    let known = places.iter().all(|place| place.thesis.is_some());
    let note = match known {
        true => "World frame; both scans with their noise, where they truly lie.",
        false => "The reference's frame; the scan where it is taken to lie.",
    };
    PanelSheet {
        title: "The scans".into(),
        notes: vec![note.into()],
        panels: places.iter().map(|place| plan_panel(place, size)).collect(),
        columns: 2,
        panel_size: (size.0 as usize, size.1 as usize),
    }
    .to_png()
}

fn plan_panel(place: &Place, size: (f64, f64)) -> Panel {
    let world_from_reference = place.world_from_reference;
    let (mut reference, mut scan) = (Vec::new(), Vec::new());
    let mut robots = vec![(world_from_reference, "reference", REFERENCE)];
    if let Some(pair) = place.pairs.first() {
        let world_from_scan = world_from_reference * pair.truth;
        let points = |cloud: &matching::PointCloud, pose: Pose2| -> Vec<(f64, f64)> {
            let at = |p: &matching::CloudPoint| pose.transform(p.position);
            cloud.points.iter().map(at).map(|p| (p.x, p.y)).collect()
        };
        reference = points(&pair.reference, world_from_reference);
        scan = points(&pair.scan, world_from_scan);
        robots.push((world_from_scan, "scan", SCAN));
    }
    let stands = robots.iter().map(|(pose, ..)| (pose.x, pose.y));
    let (x, y) = window(reference.iter().chain(&scan).copied().chain(stands), size);
    let mut series = vec![Series::pairs(WALLS, outlines(place))];
    series.push(Series::dots(REFERENCE, "reference", reference));
    let mut scan = Series::dots(SCAN, "scan", scan);
    // Small, so that the reference shows where both saw the same.
    scan.mark = Mark::Speck;
    series.push(scan);
    for (pose, name, color) in robots {
        let ahead = pose.transform(Vector2::new(0.06 * (y.1 - y.0), 0.0));
        let arrow = vec![(pose.x, pose.y), (ahead.x, ahead.y)];
        series.push(Series::pairs(color, arrow));
        let at = vec![(pose.x, pose.y)];
        let mut robot = Series::foreign(color, &format!("robot at the {name}"), at);
        robot.line = Line::None;
        series.push(robot);
    }
    let axis =
        |label: &str, range: (f64, f64)| Axis::new(label, AxisKind::Linear(range.0, range.1));
    Panel { title: place.name.clone(), x: axis("x, m", x), y: axis("y, m", y), series }
}

/// Ranges of x and y around points, equally scaled in a panel of this size.
fn window(points: impl Iterator<Item = (f64, f64)>, size: (f64, f64)) -> ((f64, f64), (f64, f64)) {
    let (low, high) = points.fold(
        (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY)),
        |(low, high), (x, y)| (low.inf(&Vector2::new(x, y)), high.sup(&Vector2::new(x, y))),
    );
    let (middle, extent) = (0.5 * (low + high), high - low);
    let inner = rendering::plot::inner_size(size);
    let scale = 1.1 * (extent.x / inner.0).max(extent.y / inner.1).max(1e-3);
    let range = |at: f64, pixels: f64| (at - 0.5 * scale * pixels, at + 0.5 * scale * pixels);
    (range(middle.x, inner.0), range(middle.y, inner.1))
}

/// The walls and the circles as polygons, as pairs of points.
fn outlines(place: &Place) -> Vec<(f64, f64)> {
    const SIDES: i32 = 24;
    let mut pairs = Vec::new();
    for wall in &place.plan.walls {
        pairs.extend([(wall.from.x, wall.from.y), (wall.to.x, wall.to.y)]);
    }
    for circle in &place.plan.circles {
        let corner = |k: i32| {
            let (s, c) = (f64::from(k) * std::f64::consts::TAU / f64::from(SIDES)).sin_cos();
            (circle.centre.x + circle.radius * c, circle.centre.y + circle.radius * s)
        };
        pairs.extend((0..SIDES).flat_map(|k| [corner(k), corner(k + 1)]));
    }
    pairs
}

/// Error by cell, a panel a situation.
pub fn errors(comparison: &Comparison) -> Result<Vec<u8>, RenderError> {
    let panels = comparison.situations.iter().map(error_panel).collect();
    PanelSheet {
        title: "Error by disturbance of the guess".into(),
        notes: notes(
            comparison,
            "Root mean square over the cell's trials; a radian counts as 3 m; below 0.1 mm at the border.",
        ),
        panels,
        columns: 2,
        panel_size: (860, 560),
    }
    .to_png()
}

/// What must be known to read a plot.
fn notes(comparison: &Comparison, first: &str) -> Vec<String> {
    let mut notes = vec![first.to_owned()];
    if comparison.situations.iter().any(|situation| situation.thesis.is_some()) {
        notes.push(
            "Dashed: the thesis's figures, of other scans of such places; it names no times."
                .into(),
        );
    }
    notes
}

fn error_panel(result: &SituationResult) -> Panel {
    let along = |cells: &[f64]| (0..).map(f64::from).zip(cells.iter().copied()).collect::<Vec<_>>();
    let mut series = foreign_rows(result, |row| along(&row.cells));
    for (k, matcher) in result.matchers.iter().enumerate() {
        let cells: Vec<f64> = matcher.cells.iter().map(|cell| cell.figures.rms_m).collect();
        // A little aside each, so that equal figures do not hide one another.
        let aside = 0.5 * ((k as f64 + 0.5) / result.matchers.len() as f64 - 0.5);
        let points = along(&cells).into_iter().map(|(x, y)| (x + aside, y)).collect();
        series.push(Series::marked(k, &matcher.matcher, points));
    }
    let names = CELL_NAMES.map(str::to_owned).to_vec();
    Panel {
        title: result.name.clone(),
        x: Axis::new("disturbance: metres/degrees", AxisKind::Names(names)),
        y: Axis::new("RMS error, m", AxisKind::Log(LEAST_M, 10.0)),
        series,
    }
}

/// The guess itself and the thesis's rows.
fn foreign_rows(
    result: &SituationResult,
    points: impl Fn(&ThesisRow) -> Vec<(f64, f64)>,
) -> Vec<Series> {
    let mut base = Series::foreign(GUESS, "the guess itself", points(&BASE));
    (base.line, base.mark) = (Line::Solid, Mark::None);
    let rows = result.thesis.and_then(|number| ROWS.get(number - 1)).into_iter().flatten();
    let rows = rows
        .zip(THESIS)
        .map(|(row, color)| Series::foreign(color, &format!("{} (thesis)", row.name), points(row)));
    std::iter::once(base).chain(rows).collect()
}

/// Error against time, a panel a situation.
pub fn error_time(comparison: &Comparison) -> Result<Vec<u8>, RenderError> {
    let times = || comparison.situations.iter().flat_map(|s| &s.matchers);
    let x =
        Axis::log_around("median time of a match, ms", times().map(|m| m.overall.median_time_ms));
    PanelSheet {
        title: "Error against time".into(),
        notes: notes(
            comparison,
            "Root mean square error over all trials of the protocol; times on the machine that ran it.",
        ),
        panels: comparison.situations.iter().map(|s| time_panel(s, &x)).collect(),
        columns: 2,
        panel_size: (760, 540),
    }
    .to_png()
}

fn time_panel(result: &SituationResult, x: &Axis) -> Panel {
    // From border to border: what lies outside an axis by logarithm is drawn at its border.
    let mut series = foreign_rows(result, |row| vec![(0.0, row.overall), (1e9, row.overall)]);
    for row in &mut series {
        row.mark = Mark::None;
    }
    for (k, matcher) in result.matchers.iter().enumerate() {
        let at = (matcher.overall.median_time_ms, matcher.overall.figures.rms_m);
        let mut one = Series::marked(k, &matcher.matcher, vec![at]);
        (one.line, one.labelled) = (Line::None, true);
        series.push(one);
    }
    let errors = result.matchers.iter().map(|m| m.overall.figures.rms_m.max(LEAST_M));
    let rows = series.iter().filter(|s| !s.labelled).flat_map(|s| &s.points);
    let values: Vec<f64> = errors.chain(rows.map(|p| p.1)).collect();
    let y = Axis::log_around("RMS error, m", values);
    Panel { title: result.name.clone(), x: x.clone(), y, series }
}
