//! One module per command.

mod bench;
pub mod cut;
mod demo;
mod edit;
pub mod eval;
mod info;
pub mod map;
mod optimize;
mod render;
mod salvage;

use crate::Outcome;
use crate::args::{Args, Command, ConfigCommand, EvalCommand};
use crate::benchmark::args::BenchCommand;
use crate::config::Config;
use anyhow::{Context, Result};

/// Runs the command that was asked for.
pub fn run(args: &Args) -> Result<Outcome> {
    let global = &args.global;
    if let Some(threads) = global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .context("cannot start the worker threads")?;
    }
    match &args.command {
        Command::Map(args) => map::run(args, global),
        Command::Cut(args) => cut::run(args, global),
        Command::Optimize(args) => optimize::run(args, global),
        Command::Render(args) => render::run(args, global),
        Command::Edit(args) => edit::run(args, global),
        Command::Info(args) => info::run(args, global),
        Command::Salvage(args) => salvage::run(args, global),
        Command::Eval(EvalCommand::Relations(args)) => eval::relations(args, global),
        Command::Eval(EvalCommand::Ate(args)) => eval::ate(args, global),
        Command::Config(ConfigCommand::Show(args)) => {
            let config = Config::load(args)?;
            crate::terminal::print(global, &config.to_toml(), &config)?;
            Ok(Outcome::Fine)
        }
        Command::Demo(args) => demo::run(args, global),
        Command::Bench(BenchCommand::Matchers(args)) => bench::matchers(args, global),
    }
}
