//! Kills writers that would go on for ever (`examples/site_story.rs`), and checks what they leave.

use crate::sites::{assert_same, noise, site_of, story};
use manifoldslam_store::{read, verify};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Steps after which the writer closes the file and opens it again: closing is interrupted too.
pub const CLOSE_EVERY: usize = 10;
/// Rounds on the same file.
const ROUNDS_PER_FILE: usize = 12;
/// The longest wait between a written step and the kill: some steps' time.
const LONGEST_WAIT: Duration = Duration::from_millis(12);

/// What happened in some rounds of killing.
#[derive(Debug, Default)]
pub struct Killed {
    /// Writers killed.
    pub rounds: usize,
    /// Steps that were told to be on disk by those writers.
    pub told: usize,
    /// Writers that left a log beside the file.
    pub with_log: usize,
    /// Writers killed before the file was there.
    pub before_creation: usize,
    /// Steps that were on disk although it was not told any more.
    pub untold: usize,
}

/// Starts a writer again and again and kills it at moments without a pattern. After each kill the
/// file opens, verifies, holds every step that was told, at most one more, and is the map of that
/// many steps, bit by bit.
pub fn kill_writers(program: &Path, folder: &Path, rounds: usize, salt: usize) -> Killed {
    let mut killed = Killed::default();
    let mut before = 0;
    for round in 0..rounds {
        let file = folder.join(format!("site-{}.manifold", round / ROUNDS_PER_FILE));
        if round % ROUNDS_PER_FILE == 0 {
            before = 0;
        }
        let told = kill_one(program, &file, round, salt).max(before);
        killed.rounds += 1;
        if !file.exists() {
            assert_eq!(told, 0, "round {round}: told, but no file");
            killed.before_creation += 1;
            continue;
        }
        let wal = file.with_extension("manifold-wal");
        killed.with_log += usize::from(std::fs::metadata(wal).is_ok_and(|log| log.len() > 0));
        let found = read(&file).unwrap_or_else(|error| panic!("round {round}: {error}"));
        let held = found.site.steps.len();
        assert!((told..=told + 1).contains(&held), "round {round}: {held} steps, {told} told");
        let (steps, _) = story(held);
        assert_same(&found.site, &site_of(&steps));
        assert_eq!(verify(&file).unwrap(), [], "round {round}");
        killed.told += told - before;
        killed.untold += held - told;
        before = held;
    }
    killed
}

/// Kills one writer; returns how many steps were told to be on disk, 0 if none in this round.
fn kill_one(program: &Path, file: &Path, round: usize, salt: usize) -> usize {
    let mut writer = Command::new(program)
        .arg("write")
        .arg(file)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("{}: {error}", program.display()));
    let mut lines = BufReader::new(writer.stdout.take().unwrap()).lines();
    let mut last = String::from("0");
    let await_steps = (noise(round, salt) * 2.5 * CLOSE_EVERY as f64) as usize;
    for _ in 0..await_steps {
        last = lines.next().unwrap().unwrap();
    }
    std::thread::sleep(LONGEST_WAIT.mul_f64(noise(round, salt + 1)));
    writer.kill().unwrap();
    assert!(!writer.wait().unwrap().success());
    // What it told before it died.
    for line in lines.map_while(Result::ok) {
        last = line;
    }
    last.parse().unwrap()
}
