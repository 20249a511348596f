use crate::cargo;
use crate::runner::Run;
use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

/// Runs all tests and lets their output through; counts what passed and what says it was skipped.
pub fn check(run: &mut Run) -> Result<()> {
    let arguments = ["test", "--release", "--workspace", "--locked", "--", "--show-output"];
    println!("$ cargo {}", arguments.join(" "));
    let mut child = cargo::command(&arguments).stdout(Stdio::piped()).spawn().context("cargo")?;
    let stdout = child.stdout.take().context("no output of the tests")?;
    let mut report = Report::default();
    for line in BufReader::new(stdout).lines() {
        let line = line.context("the tests' output")?;
        if report.read(&line) {
            println!("{line}");
        }
    }
    let status = child.wait().context("cargo test")?;
    run.note(format!(
        "{} tests passed, {} failed, {} ignored, in {} test programs",
        report.passed, report.failed, report.ignored, report.programs
    ));
    let data = run.workspace.root.join("../shared/data");
    if data.is_dir() {
        run.note("shared evaluation data found: its tests ran");
    } else {
        let count = report.skipped.len();
        run.note(format!("NOT RUN: shared evaluation data not found: {count} tests skipped"));
    }
    report.skipped.iter().for_each(|line| run.note(format!("skipped: {line}")));
    if !status.success() {
        bail!("cargo test ended with {status}");
    }
    if report.passed == 0 {
        bail!("no test ran");
    }
    Ok(())
}

/// What the output of the test runner says.
#[derive(Default)]
struct Report {
    passed: usize,
    failed: usize,
    ignored: usize,
    programs: usize,
    skipped: Vec<String>,
    /// Inside the output of tests that passed.
    quiet: bool,
}

impl Report {
    /// Takes one line in; false for lines of passed tests, which one would not see without
    /// `--show-output`.
    fn read(&mut self, line: &str) -> bool {
        if line == "successes:" {
            self.quiet = true;
        } else if line == "failures:" {
            self.quiet = false;
        } else if let Some(counts) = line.strip_prefix("test result: ") {
            self.quiet = false;
            self.programs += 1;
            self.passed += count(counts, "passed");
            self.failed += count(counts, "failed");
            self.ignored += count(counts, "ignored");
        } else if self.quiet && line.starts_with("skipped: ") {
            self.skipped.push(line["skipped: ".len()..].to_owned());
        }
        !self.quiet
    }
}

/// The number before a word, as in `12 passed`.
fn count(line: &str, word: &str) -> usize {
    let before = line.split(word).next().unwrap_or_default().trim_end();
    before.rsplit(' ').next().and_then(|n| n.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_runner() {
        let mut report = Report::default();
        let lines = [
            ("running 2 tests", true),
            ("test a ... ok", true),
            ("successes:", false),
            ("---- a stdout ----", false),
            ("skipped: no logs", false),
            ("successes:", false),
            ("    a", false),
            ("test result: ok. 12 passed; 3 failed; 1 ignored; 0 measured; 0 filtered out", true),
            ("skipped: not in a test", true),
        ];
        for (line, shown) in lines {
            assert_eq!(report.read(line), shown, "{line}");
        }
        assert_eq!((report.passed, report.failed, report.ignored, report.programs), (12, 3, 1, 1));
        assert_eq!(report.skipped, ["no logs"]);
    }
}
