//! Writers are killed; what they wrote is there.

use crate::killing::kill_writers;
use crate::sites::Scratch;

#[test]
fn a_killed_writer_loses_at_most_the_step_it_was_writing() {
    let scratch = Scratch::new("kill");
    // Cargo builds examples beside tests.
    let folder = std::env::current_exe().unwrap();
    let program = folder.parent().unwrap().with_file_name("examples").join("site_story");
    let killed = kill_writers(&program, &scratch.at(""), 30, 1);
    println!("{killed:?}");
    assert!(killed.told > 100 && killed.with_log > 5, "{killed:?}");
}
