use anyhow::{Context, Result, bail};
use std::process::{Command, Stdio};

/// The cargo that runs us.
pub fn command(arguments: &[&str]) -> Command {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(arguments);
    command
}

/// Runs cargo, its output going where ours goes.
pub fn run(arguments: &[&str]) -> Result<()> {
    run_with(arguments, &[])
}

/// The same with environment variables.
pub fn run_with(arguments: &[&str], variables: &[(&str, &str)]) -> Result<()> {
    println!("$ cargo {}", arguments.join(" "));
    let status = command(arguments).envs(variables.iter().copied()).status().context("cargo")?;
    if !status.success() {
        bail!("cargo {} ended with {status}", arguments[0]);
    }
    Ok(())
}

/// Standard output of a cargo command that must succeed.
pub fn output(arguments: &[&str]) -> Result<String> {
    let output = command(arguments).stderr(Stdio::inherit()).output().context("cargo")?;
    if !output.status.success() {
        bail!("cargo {} ended with {}", arguments[0], output.status);
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// Is a component such as `fmt` or `clippy` installed?
pub fn has(component: &str) -> bool {
    let probe =
        command(&[component, "--version"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
    probe.is_ok_and(|status| status.success())
}
