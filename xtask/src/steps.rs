use crate::runner::{Run, Step};
use crate::{cargo, edges, end_to_end, links, source, tests_step};
use anyhow::Result;

/// Everything that is checked, cheap steps first.
pub fn all() -> Vec<Step> {
    let step = |name, what, advice, work| Step { name, what, advice, work, needed: false };
    vec![
        step("format", "rustfmt", "run `cargo fmt --all` and commit", format),
        step(
            "source",
            "line widths, function lengths, machine paths, what the core may use",
            "`cargo xtask wrap-comments` wraps comments; split long functions; \
             keep files, clocks and threads out of the core (ARCHITECTURE.md)",
            source::check,
        ),
        step(
            "edges",
            "crates depend downwards only",
            "remove the dependency, or write an ADR and add it to xtask/src/edges.rs",
            edges::check,
        ),
        step("links", "links between documents; change log", "correct the link", links::check),
        step("clippy", "clippy, warnings are errors", "read the lint; fix the cause", clippy),
        Step {
            needed: true,
            ..step("build", "release build", "read the first compiler error", build)
        },
        step(
            "tests",
            "all tests, release profile",
            "run the failing test alone: `cargo test --release -p CRATE NAME -- --nocapture`",
            tests_step::check,
        ),
        step("doc", "documentation, warnings are errors", "correct the doc comment", doc),
        step(
            "examples",
            "the numbered examples run",
            "run it alone: `cargo run --release -p PACKAGE --example NAME`",
            end_to_end::examples,
        ),
        step(
            "demo",
            "`cargo demo` twice, on 1 and 2 threads: complete and byte-identical",
            "run `cargo demo` and compare the folders",
            end_to_end::demo,
        ),
        step(
            "bad-input",
            "bad input and usage end with a message and the right exit code",
            "run the command shown; exit codes are in ARCHITECTURE.md",
            end_to_end::bad_input,
        ),
    ]
}

fn format(run: &mut Run) -> Result<()> {
    if !cargo::has("fmt") {
        return run.missing_tool("rustfmt is not installed (`rustup component add rustfmt`)");
    }
    cargo::run(&["fmt", "--all", "--", "--check"])
}

/// In the release profile, so that build scripts and procedural macros are those of the build.
fn clippy(run: &mut Run) -> Result<()> {
    if !cargo::has("clippy") {
        return run.missing_tool("clippy is not installed (`rustup component add clippy`)");
    }
    cargo::run(&[
        "clippy",
        "--release",
        "--workspace",
        "--all-targets",
        "--locked",
        "--",
        "-D",
        "warnings",
    ])
}

fn build(_: &mut Run) -> Result<()> {
    cargo::run(&["build", "--release", "--workspace", "--locked"])
}

fn doc(_: &mut Run) -> Result<()> {
    let arguments = ["doc", "--release", "--workspace", "--no-deps", "--locked"];
    cargo::run_with(&arguments, &[("RUSTDOCFLAGS", "-D warnings")])
}
