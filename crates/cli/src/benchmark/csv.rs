use super::Comparison;
use super::accuracy::Accuracy;
use super::degenerate::Statuses;
use super::situations::CellResult;
use matching::protocol::CELL_NAMES;
use std::fmt::Write;

/// One row per matcher, situation and cell, and one for all cells together.
pub fn matchers(comparison: &Comparison) -> String {
    let mut text = String::from(
        "situation,matcher,cell,trials,rms_m,mean_m,median_m,success,misled,iterations,median_time_ms\n",
    );
    for situation in &comparison.situations {
        for matcher in &situation.matchers {
            let cells = CELL_NAMES.into_iter().zip(&matcher.cells);
            for (name, cell) in cells.chain([("all", &matcher.overall)]) {
                let CellResult { figures: f, median_time_ms } = cell;
                let _ = writeln!(
                    text,
                    "{},{},{name},{},{:.9},{:.9},{:.9},{:.6},{:.6},{:.4},{:.6}",
                    situation.name,
                    matcher.matcher,
                    f.trials,
                    f.rms_m,
                    f.mean_m,
                    f.median_m,
                    f.success,
                    f.misled,
                    f.iterations,
                    median_time_ms,
                );
            }
        }
    }
    text
}

/// One row per matcher and place with a Cramer-Rao bound; empty where there is no figure.
pub fn accuracy(comparison: &Comparison) -> String {
    let mut text = String::from(
        "place,matcher,trials,failures,translation_rmse_m,yaw_rmse_deg,translation_efficiency,yaw_efficiency,\
         efficiency,nees,median_time_ms\n",
    );
    for situation in &comparison.situations {
        for matcher in &situation.matchers {
            if let Some(found) = &matcher.nearby {
                accuracy_row(&mut text, &situation.name, &matcher.matcher, found);
            }
        }
    }
    for place in &comparison.accuracy {
        for matcher in &place.matchers {
            accuracy_row(&mut text, &place.name, &matcher.matcher, &matcher.accuracy);
        }
    }
    text
}

fn accuracy_row(text: &mut String, place: &str, matcher: &str, found: &Accuracy) {
    let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.6}"));
    let _ = writeln!(
        text,
        "{place},{matcher},{},{},{},{},{},{},{},{},{:.6}",
        found.trials,
        found.failures,
        number(found.translation_rmse_m),
        number(found.yaw_rmse_deg),
        number(found.translation_efficiency),
        number(found.yaw_efficiency),
        number(found.efficiency),
        number(found.nees),
        found.median_time_ms,
    );
}

/// One row per matcher and place with an open direction; empty where no weak axis was named.
pub fn degenerate(comparison: &Comparison) -> String {
    let mut text = String::from(
        "place,matcher,converged,degenerate,ambiguous,too_few_points,diverged,weak_axis_off_deg,observed_rmse_m\n",
    );
    for place in &comparison.degenerate {
        for row in &place.matchers {
            let counts = statuses(&row.statuses);
            let angle = row.weak_axis_off_deg.map_or(String::new(), |v| format!("{v:.6}"));
            let (name, matcher, rmse) = (&place.name, &row.matcher, row.observed_rmse_m);
            let _ = writeln!(text, "{name},{matcher},{counts},{angle},{rmse:.9}");
        }
    }
    text
}

/// One row per matcher on a real log.
pub fn log(comparison: &Comparison) -> String {
    let mut text = String::from(
        "log,matcher,translation_median_m,translation_95_m,yaw_median_deg,yaw_95_deg,inlier_ratio,converged,\
         degenerate,ambiguous,too_few_points,diverged,iterations,median_time_ms\n",
    );
    for log in comparison.log.iter() {
        for row in &log.matchers {
            let _ = writeln!(
                text,
                "{},{},{:.6},{:.6},{:.6},{:.6},{:.4},{},{:.4},{:.6}",
                log.log,
                row.matcher,
                row.translation_median_m,
                row.translation_95_m,
                row.yaw_median_deg,
                row.yaw_95_deg,
                row.inlier_ratio,
                statuses(&row.statuses),
                row.iterations,
                row.median_time_ms,
            );
        }
    }
    text
}

fn statuses(counts: &Statuses) -> String {
    let Statuses { converged, degenerate, ambiguous, too_few_points, diverged } = counts;
    format!("{converged},{degenerate},{ambiguous},{too_few_points},{diverged}")
}
