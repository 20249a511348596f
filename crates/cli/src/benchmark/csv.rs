use super::Comparison;
use super::accuracy::Accuracy;
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
            if let Some(found) = &matcher.undisturbed {
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
