use crate::workspace::Workspace;
use anyhow::{Result, bail};
use std::process::ExitCode;
use std::time::Instant;

/// One thing that is checked.
pub struct Step {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it checks.
    pub what: &'static str,
    /// What to do when it fails.
    pub advice: &'static str,
    /// The check.
    pub work: fn(&mut Run) -> Result<()>,
    /// Later steps make no sense when this one has failed.
    pub needed: bool,
}

/// What the steps of one run share.
pub struct Run {
    /// The workspace under test.
    pub workspace: Workspace,
    /// What ran, and what did not; printed at the end.
    pub notes: Vec<String>,
    strict: bool,
}

impl Run {
    /// Something that helps to check is not installed. A failure where CI=true, a remark elsewhere.
    pub fn missing_tool(&mut self, what: &str) -> Result<()> {
        if self.strict {
            bail!("{what}; with CI=true everything must run");
        }
        self.notes.push(format!("NOT RUN: {what}"));
        Ok(())
    }

    /// A line for the summary.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }
}

/// Runs the steps named, or all; prints each with its time, and a summary.
pub fn run(steps: &[Step], names: &[&str]) -> ExitCode {
    if let Some(unknown) = names.iter().find(|name| steps.iter().all(|step| step.name != **name)) {
        eprintln!("no step is called {unknown}; see `cargo xtask list`");
        return ExitCode::from(2);
    }
    let workspace = match Workspace::load() {
        Ok(workspace) => workspace,
        Err(error) => {
            eprintln!("cannot read the workspace: {error:#}");
            return ExitCode::FAILURE;
        }
    };
    let strict = std::env::var("CI").is_ok_and(|value| value == "true");
    let mut run = Run { workspace, notes: Vec::new(), strict };
    let start = Instant::now();
    let mut table = Vec::new();
    for step in steps.iter().filter(|step| names.is_empty() || names.contains(&step.name)) {
        println!("\n=== {}: {}", step.name, step.what);
        let begin = Instant::now();
        let result = (step.work)(&mut run);
        let seconds = begin.elapsed().as_secs_f64();
        let verdict = if result.is_ok() { "ok" } else { "FAILED" };
        println!("=== {}: {verdict}, {seconds:.1} s", step.name);
        if let Err(error) = &result {
            println!("{error:#}\nWhat to do: {}", step.advice);
        }
        table.push((step.name, verdict, seconds));
        if result.is_err() && step.needed {
            println!("The steps after it need it and were not run.");
            break;
        }
    }
    summary(&table, &run.notes, steps.len(), start.elapsed().as_secs_f64())
}

fn summary(table: &[(&str, &str, f64)], notes: &[String], all: usize, seconds: f64) -> ExitCode {
    println!("\n=== summary");
    for (name, verdict, seconds) in table {
        println!("{name:<12} {verdict:<8} {seconds:7.1} s");
    }
    notes.iter().for_each(|note| println!("- {note}"));
    let failed = table.iter().filter(|(_, verdict, _)| *verdict != "ok").count();
    let left_out = all - table.len();
    println!(
        "{} steps ok, {failed} failed, {left_out} not run; {seconds:.0} s",
        table.len() - failed
    );
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
