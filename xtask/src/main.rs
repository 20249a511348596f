//! The checks of `cargo ci`, with cargo and a C compiler alone.
//!
//! `cargo ci` runs every step; `cargo ci STEP...` runs some; `cargo xtask list` names them;
//! `cargo xtask wrap-comments` breaks comment lines that are too long, which rustfmt does not.

mod cargo;
mod edges;
mod end_to_end;
mod inputs;
mod links;
mod runner;
mod source;
mod steps;
mod tests_step;
mod workspace;
mod wrap;

use std::process::ExitCode;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let names: Vec<&str> = words.iter().skip(1).map(String::as_str).collect();
    match words.first().map(String::as_str) {
        Some("ci") => runner::run(&steps::all(), &names),
        Some("list") => {
            steps::all().iter().for_each(|step| println!("{:<12} {}", step.name, step.what));
            ExitCode::SUCCESS
        }
        Some("wrap-comments") => wrap::run(),
        _ => {
            eprintln!("usage: cargo ci [STEP...] | cargo xtask list | cargo xtask wrap-comments");
            ExitCode::from(2)
        }
    }
}
