//! `manifoldslam`: one accurate, detailed map from laser logs.
//!
//! The only place with messages, exit codes and a clock. Every command is a function in `commands`
//! that returns an [`Outcome`]; everything else here serves them.

mod args;
mod atomic;
mod bad_data;
mod benchmark;
mod commands;
mod config;
mod crossing;
mod drawing;
mod islands;
mod landmarks;
mod level_maps;
mod mapping;
mod metrics;
mod reading;
mod report;
mod result;
mod result_folder;
mod scoring;
mod site_info;
mod site_writer;
mod terminal;
mod tracks;

use clap::Parser;
use std::process::ExitCode;

/// How a command that did not fail ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything went well.
    Fine,
    /// Finished, but some of the input could not be used.
    DataLost,
}

/// Exit codes: 0 fine, 1 failed, 2 usage (by clap), 3 finished but data was lost.
fn main() -> ExitCode {
    let args = args::Args::parse();
    match commands::run(&args) {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::DataLost) => ExitCode::from(3),
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("manifoldslam: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// True when whoever read our output has left, as `head` does: no failure of ours.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|cause| cause.kind() == std::io::ErrorKind::BrokenPipe)
}
