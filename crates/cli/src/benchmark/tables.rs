use super::Comparison;
use super::accuracy::Accuracy;
use super::degenerate::DegenerateResult;
use super::real_log::LogResult;
use super::rooms::AccuracyResult;
use super::situations::{MatcherResult, SituationResult};
use super::table::Table;
use super::thesis::{BASE, ROWS, ThesisRow};
use matching::protocol::CELL_NAMES;

/// A part of the result: a heading, what must be known to read it, a table.
pub struct Section {
    heading: String,
    note: String,
    table: Table,
}

impl Section {
    /// For a terminal.
    pub fn to_text(&self) -> String {
        format!("{}\n{}\n{}", self.heading, self.note, self.table.to_text())
    }

    /// As Markdown.
    pub fn to_markdown(&self) -> String {
        format!("## {}\n\n{}\n\n{}", self.heading, self.note, self.table.to_markdown())
    }
}

/// All tables of a comparison.
pub fn sections(comparison: &Comparison) -> Vec<Section> {
    let mut all: Vec<Section> =
        comparison.situations.iter().map(|s| situation(s, comparison)).collect();
    let nearby: Vec<_> = comparison.situations.iter().filter_map(nearby).collect();
    all.extend(nearby);
    all.extend(comparison.accuracy.iter().map(accuracy));
    all.extend(comparison.degenerate.iter().map(degenerate));
    all.extend(comparison.log.iter().map(log));
    all
}

fn situation(result: &SituationResult, comparison: &Comparison) -> Section {
    let header = ["matcher"].into_iter().chain(CELL_NAMES);
    let mut table = Table::new(header.chain(["all", "found %", "misled %", "iter.", "ms"]));
    for matcher in &result.matchers {
        table.row(matcher_row(matcher));
    }
    table.row(thesis_row(&BASE, "base (the guess)"));
    let rows = result.thesis.and_then(|number| ROWS.get(number - 1));
    for row in rows.into_iter().flatten() {
        table.row(thesis_row(row, &format!("{} (thesis)", row.name)));
    }
    let trials = result.matchers.first().map_or(0, |m| m.overall.figures.trials);
    let about = match result.thesis {
        Some(number) => format!(
            "situation {number} of the thesis; noise: {}. The thesis's scans are not published: its rows \
             are of other scans of such a place",
            comparison.noise
        ),
        None => "scans of one's own; what is taken for the truth may itself be off".to_owned(),
    };
    Section {
        heading: format!(
            "{}: {:.2} m and {:.1} degrees apart",
            result.name, result.distance_m, result.turn_deg
        ),
        note: format!(
            "Root mean square error in metres (a radian as 3 m) by disturbance of the guess in \
             m/degrees; {trials} trials a matcher; {about}."
        ),
        table,
    }
}

fn matcher_row(matcher: &MatcherResult) -> Vec<String> {
    let all = &matcher.overall;
    let mut row = vec![matcher.matcher.clone()];
    row.extend(matcher.cells.iter().map(|cell| error(cell.figures.rms_m)));
    row.extend([
        error(all.figures.rms_m),
        format!("{:.1}", 100.0 * all.figures.success),
        format!("{:.1}", 100.0 * all.figures.misled),
        format!("{:.1}", all.figures.iterations),
        format!("{:.3}", all.median_time_ms),
    ]);
    row
}

fn thesis_row(row: &ThesisRow, name: &str) -> Vec<String> {
    let nothing = || "-".to_owned();
    let mut cells = vec![name.to_owned()];
    cells.extend(row.cells.iter().map(|value| error(*value)));
    let iterations = match row.iterations {
        n if n.is_finite() => format!("{n:.1}"),
        _ => nothing(),
    };
    cells.extend([error(row.overall), nothing(), nothing(), iterations, nothing()]);
    cells
}

/// Small disturbances against the bound.
fn nearby(result: &SituationResult) -> Option<Section> {
    let mut table = accuracy_table();
    for matcher in &result.matchers {
        table.row(accuracy_row(&matcher.matcher, matcher.nearby.as_ref()?));
    }
    let trials = result.matchers.first()?.nearby?.trials;
    Some(Section {
        heading: format!("{}: accuracy from nearby", result.name),
        note: format!("{trials} matches from 3 cm and 0.6 degrees. {ACCURACY_NOTE}"),
        table,
    })
}

const ACCURACY_NOTE: &str = "Errors of matches within 0.1 m (a radian as 3 m); x bound: over the Cramer-Rao bound of \
     what both sides see, 1 at best; NEES: median squared error by the matcher's own covariance over that \
     expected, above 1 where it claims too much.";

fn accuracy_table() -> Table {
    Table::new([
        "matcher",
        "lost",
        "mm",
        "deg",
        "x bound mm",
        "x bound deg",
        "x bound",
        "NEES",
        "ms",
    ])
}

fn accuracy_row(name: &str, found: &Accuracy) -> Vec<String> {
    let with = |value: Option<f64>, decimals: usize| {
        value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"))
    };
    let ratio = |value| with(value, 2);
    vec![
        name.to_owned(),
        found.failures.to_string(),
        with(found.translation_rmse_m.map(|m| 1e3 * m), 2),
        with(found.yaw_rmse_deg, 4),
        ratio(found.translation_efficiency),
        ratio(found.yaw_efficiency),
        ratio(found.efficiency),
        ratio(found.nees),
        format!("{:.3}", found.median_time_ms),
    ]
}

fn accuracy(result: &AccuracyResult) -> Section {
    let mut table = accuracy_table();
    for matcher in &result.matchers {
        table.row(accuracy_row(&matcher.matcher, &matcher.accuracy));
    }
    let trials = result.matchers.first().map_or(0, |m| m.accuracy.trials);
    let about = match result.name.as_str() {
        "rooms" => "random rooms, scan to scan, 0.3 m and 10 degrees apart",
        _ => "random rooms, a scan against six at their true poses",
    };
    Section {
        heading: format!("{}: {about}", result.name),
        note: format!(
            "{trials} matches from 3 cm and 0.6 degrees; {:.0} mm of Gaussian range noise. {ACCURACY_NOTE}",
            1e3 * result.range_std_m
        ),
        table,
    }
}

fn degenerate(result: &DegenerateResult) -> Section {
    let header = ["matcher", "converged", "degenerate", "ambiguous", "too few", "diverged"];
    let mut table = Table::new(header.into_iter().chain(["axis off deg", "observed mm"]));
    for row in &result.matchers {
        let counts = &row.statuses;
        table.row([
            row.matcher.clone(),
            counts.converged.to_string(),
            counts.degenerate.to_string(),
            counts.ambiguous.to_string(),
            counts.too_few_points.to_string(),
            counts.diverged.to_string(),
            row.weak_axis_off_deg.map_or("-".to_owned(), |angle| format!("{angle:.2}")),
            format!("{:.2}", 1e3 * row.observed_rmse_m),
        ]);
    }
    Section {
        heading: format!("{}: a direction that cannot be observed", result.name),
        note: "How the matches ended (degenerate is right); the weak axes named, off the true one; RMS error \
               along the directions that are observed."
            .to_owned(),
        table,
    }
}

fn log(result: &LogResult) -> Section {
    let header = ["matcher", "mm", "95 %", "deg", "95 %", "inliers %", "conv.", "degen.", "amb."];
    let mut table = Table::new(header.into_iter().chain(["few", "div.", "iter.", "ms"]));
    for row in &result.matchers {
        let counts = &row.statuses;
        table.row([
            row.matcher.clone(),
            format!("{:.1}", 1e3 * row.translation_median_m),
            format!("{:.1}", 1e3 * row.translation_95_m),
            format!("{:.3}", row.yaw_median_deg),
            format!("{:.3}", row.yaw_95_deg),
            format!("{:.1}", 100.0 * row.inlier_ratio),
            counts.converged.to_string(),
            counts.degenerate.to_string(),
            counts.ambiguous.to_string(),
            counts.too_few_points.to_string(),
            counts.diverged.to_string(),
            format!("{:.1}", row.iterations),
            format!("{:.3}", row.median_time_ms),
        ]);
    }
    Section {
        heading: format!("{}: agreement on {} pairs of scans", result.log, result.pairs),
        note: format!(
            "From odometry; difference from the consensus, the median of all usable answers by coordinate \
             ({} pairs have none). There is no truth here: matchers may agree and be wrong.",
            result.without_consensus
        ),
        table,
    }
}

/// Metres with four decimals, fewer where many would be idle.
fn error(metres: f64) -> String {
    if metres < 10.0 { format!("{metres:.4}") } else { format!("{metres:.1}") }
}
