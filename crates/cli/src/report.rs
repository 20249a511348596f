use crate::bad_data::warnings;
use crate::config::Config;
use crate::islands::title;
use crate::mapping::MappedTeam;
use crate::metrics::Metrics;
use crate::result::Drawn;
use anyhow::Result;
use rendering::{Annotations, Report};
use slam::{Merge, MergeState};

/// A run's report as a page.
pub fn report(
    mapped: &MappedTeam,
    drawn: &[Drawn],
    metrics: &Metrics,
    config: &Config,
) -> Result<String> {
    let names: Vec<&str> = mapped.robots.iter().map(|robot| robot.name.as_str()).collect();
    let mut report = Report::new(&title(&names));
    for (k, island) in drawn.iter().enumerate() {
        if drawn.len() > 1 {
            report.heading(&format!("Island {}: {}", k + 1, island.title));
        }
        for level in &island.levels {
            let trajectories = level.trajectories(&mapped.names());
            let annotations = level.annotations(&trajectories);
            report.map(&level.grid, &Annotations { patches: &level.patches, ..annotations })?;
        }
        if !island.levels.is_empty() {
            continue;
        }
        let annotations = Annotations {
            title: Some(&island.title),
            trajectories: &island.trajectories(mapped),
            patches: &island.patches,
            closures: &island.marks,
            ..Annotations::default()
        };
        report.map(&island.grid, &annotations)?;
    }
    for warning in warnings(metrics) {
        report.paragraph(&format!("Left out: {warning}."));
    }
    if mapped.robots.len() > 1 || drawn.len() > 1 {
        robots(&mut report, metrics);
        merges(&mut report, metrics);
    }
    report.heading("Figures").values(&serde_json::to_value(metrics)?);
    report.heading("Configuration").values(&serde_json::to_value(config)?);
    Ok(report.to_html())
}

fn robots(report: &mut Report, metrics: &Metrics) {
    let rows: Vec<Vec<String>> = metrics
        .logs
        .iter()
        .map(|log| {
            let islands: Vec<String> = log.islands.iter().map(ToString::to_string).collect();
            vec![
                log.robot.clone(),
                log.file.clone(),
                log.facts.scans.to_string(),
                format!("{:.1}", log.path_m),
                islands.join(", "),
            ]
        })
        .collect();
    report.heading("Robots").table(&["robot", "log", "scans", "path, m", "island"], &rows);
    for failure in &metrics.failures {
        report.paragraph(&format!("Not mapped: {failure}"));
    }
}

/// Which islands were joined on what evidence, and which may be but are not.
fn merges(report: &mut Report, metrics: &Metrics) {
    let of = |state| metrics.merges.iter().filter(move |merge| merge.state == state);
    report.heading("Merges");
    let sections = [
        (MergeState::Merged, "Islands that were joined:", "No islands were joined."),
        (
            MergeState::Provisional,
            "Islands that may belong together, but the evidence is not enough to join them:",
            "",
        ),
    ];
    for (state, some, none) in sections {
        let rows: Vec<Vec<String>> = of(state).map(row).collect();
        if rows.is_empty() {
            if !none.is_empty() {
                report.paragraph(none);
            }
            continue;
        }
        let header = [
            "one",
            "the other",
            "relations",
            "agreeing",
            "contradicting",
            "surface compared",
            "of it contradicted",
            "rooms beyond a copy",
            "estimated chance of being wrong",
        ];
        report.paragraph(some).table(&header, &rows);
    }
}

fn row(merge: &Merge) -> Vec<String> {
    vec![
        title(&merge.robots[0]),
        title(&merge.robots[1]),
        merge.relations.len().to_string(),
        merge.evidence.agreeing.to_string(),
        merge.evidence.contradicting.to_string(),
        format!("{} m", merge.evidence.compared_m),
        format!("{:.1} m", f64::from(merge.evidence.contradicted_cm) / 100.0),
        merge.evidence.beyond.to_string(),
        format!("{:.1e}", merge.false_bound),
    ]
}
