//! The program from outside: what it writes, what it says, how it ends.

// A test that cannot unwrap has failed.
#![allow(clippy::unwrap_used)]

#[path = "oracles/bad_data.rs"]
mod bad_data;
#[path = "oracles/bad_input.rs"]
mod bad_input;
#[path = "oracles/benchmark.rs"]
mod benchmark;
#[path = "oracles/commands.rs"]
mod commands;
#[path = "oracles/cut.rs"]
mod cut;
#[path = "oracles/editing.rs"]
mod editing;
#[path = "oracles/landmarks.rs"]
mod landmarks;
#[path = "oracles/levels.rs"]
mod levels;
#[path = "oracles/scores.rs"]
mod scores;
#[path = "oracles/sites.rs"]
mod sites;
#[path = "oracles/teams.rs"]
mod teams;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// A folder of one test, removed at its end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let name = format!("manifoldslam-cli-{name}-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file and returns its path.
    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        std::fs::write(self.at(name), content).unwrap();
        self.at(name)
    }

    /// Names of everything in the folder, hidden things included.
    fn names(&self) -> Vec<String> {
        names(&self.0)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// What a run of the program left.
struct Ran {
    code: i32,
    out: String,
    err: String,
}

fn run<S: AsRef<std::ffi::OsStr>>(args: impl IntoIterator<Item = S>) -> Ran {
    let output: Output =
        Command::new(env!("CARGO_BIN_EXE_manifoldslam")).args(args).output().unwrap();
    Ran {
        code: output.status.code().unwrap(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Arguments of any kind as strings.
macro_rules! args {
    ($($arg:expr),* $(,)?) => {
        [$(std::ffi::OsString::from($arg)),*]
    };
}
use args;

/// The demo's log, made once.
fn demo_log() -> &'static str {
    static LOG: OnceLock<String> = OnceLock::new();
    LOG.get_or_init(|| {
        let scratch = Scratch::new("demo-log");
        let ran = run(args!["demo", "-o", scratch.at("demo")]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        std::fs::read_to_string(scratch.at("demo/demo.clf")).unwrap()
    })
}

/// The demo's first scans: enough for a map, quickly mapped.
fn short_log() -> String {
    demo_log().lines().take(121).map(|line| format!("{line}\n")).collect()
}
