//! Damage of every kind: the file is refused with the reason, or it is the same; what is salvaged
//! is the same, or the loss is told. Nothing ever panics or becomes another map.

use crate::sites::{Scratch, assert_same, story};
use manifold::Manifold;
use manifoldslam_store::{
    SCHEMA_VERSION, Site, SqliteStore, Step, Store, StoreError, read, salvage, same_map, verify,
};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Steps in the file that is damaged: enough for every kind of change.
const STEPS: usize = 14;

fn written(scratch: &Scratch) -> (PathBuf, Vec<Step>, Site) {
    let file = scratch.at("site.manifold");
    let (steps, site) = story(STEPS);
    let mut store = SqliteStore::create(&file, "test").unwrap();
    steps.iter().for_each(|step| store.write(step).unwrap());
    store.close().unwrap();
    (file, steps, site)
}

/// The maps after every change, without their scans: a salvaged map is one of them.
fn prefixes(steps: &[Step]) -> Vec<Manifold> {
    let mut map = Manifold::new();
    let mut maps = vec![map.clone()];
    for change in steps.iter().flat_map(|step| &step.changes) {
        map.apply(change).unwrap();
        map.take_journal();
        maps.push(map.clone());
    }
    maps
}

/// Opens the file: the same, or refused, and then what is salvaged is the same or tells its loss.
/// True when it was refused.
fn same_or_told(file: &Path, expected: &Site, prefixes: &[Manifold], what: &str) -> bool {
    let error = match read(file) {
        Ok(found) => {
            assert_same(&found.site, expected);
            return false;
        }
        Err(error) => error,
    };
    assert!(!error.to_string().is_empty(), "{what}");
    match salvage(file) {
        Ok(salvaged) if salvaged.lost.is_empty() => assert_same(&salvaged.site, expected),
        Ok(salvaged) => {
            let map = &salvaged.site.manifold;
            let lost_scans = salvaged.lost.iter().filter(|f| f.place == "scans").count();
            let is_prefix = prefixes.iter().any(|p| same_map(p, map));
            assert!(is_prefix || lost_scans > 0, "{what}: another map; {error}; {salvaged:?}");
            let patches = prefixes.last().unwrap().patches();
            let same = map.patches().iter().zip(patches).filter(|(a, b)| a.scan == b.scan).count();
            assert_eq!(same + lost_scans, map.patches().len(), "{what}: another scan");
        }
        Err(StoreError::Newer { .. } | StoreError::Foreign { .. }) => {}
        Err(error) => panic!("{what}: {error}"),
    }
    true
}

/// Flips a bit of every byte that is not 0 and of every `stride`-th byte that is; salvages every
/// `salvage_every`-th file that is refused. Returns how many were tried and how many refused.
fn flip(scratch: &Scratch, stride: usize, salvage_every: usize) -> (usize, usize) {
    let (file, steps, expected) = written(scratch);
    let prefixes = prefixes(&steps);
    let bytes = std::fs::read(&file).unwrap();
    let open = std::fs::OpenOptions::new().write(true).open(&file).unwrap();
    let (mut tried, mut refused) = (0, 0);
    let chosen = bytes.iter().enumerate().filter(|(at, byte)| **byte != 0 || at % stride == 0);
    for (at, &byte) in chosen {
        let flipped = byte ^ 1 << (at * 5 % 8);
        open.write_all_at(&[flipped], at as u64).unwrap();
        let was_refused = if refused % salvage_every == 0 {
            same_or_told(&file, &expected, &prefixes, &format!("byte {at}"))
        } else {
            read(&file).map(|found| assert_same(&found.site, &expected)).is_err()
        };
        (tried, refused) = (tried + 1, refused + usize::from(was_refused));
        open.write_all_at(&[byte], at as u64).unwrap();
    }
    assert!(std::fs::read(&file).unwrap() == bytes, "opening or salvaging has changed the file");
    assert_eq!(verify(&file).unwrap(), []);
    (tried, refused)
}

#[test]
fn a_flipped_bit_is_found_or_harmless() {
    let (tried, refused) = flip(&Scratch::new("flips"), 16, 9);
    println!("{refused} of {tried} flips refused");
    assert!(refused > 10_000, "{refused}");
}

#[test]
#[ignore = "a minute or two; bench/store/flips.sh runs it"]
fn every_byte_flipped_is_found_or_harmless() {
    let (tried, refused) = flip(&Scratch::new("all-flips"), 1, 1);
    println!("{refused} of {tried} flips refused, each salvaged");
    assert!(refused > 10_000, "{refused}");
}

#[test]
fn a_truncated_file_is_refused_and_salvaged() {
    let scratch = Scratch::new("cut");
    let (file, steps, expected) = written(&scratch);
    let prefixes = prefixes(&steps);
    let bytes = std::fs::read(&file).unwrap();
    for length in (0..bytes.len()).step_by(512) {
        std::fs::write(&file, &bytes[..length]).unwrap();
        let what = format!("{length} bytes");
        assert!(same_or_told(&file, &expected, &prefixes, &what), "{what}");
        assert!(SqliteStore::open(&file, "test").is_err(), "{what}");
        // The second page holds the versions: from there on it is known as ours.
        assert_eq!(salvage(&file).is_ok(), length >= 2 * 4096, "{what}");
        assert_eq!(std::fs::read(&file).unwrap().len(), length, "refusing has changed the file");
    }
}

#[test]
fn what_is_salvaged_becomes_a_file() {
    let scratch = Scratch::new("salvaged");
    let (file, _, expected) = written(&scratch);
    let database = rusqlite::Connection::open(&file).unwrap();
    // A patch's scan, a state row that the journal has too, and the end of the journal.
    let spoil = "UPDATE scans SET data = x'00' WHERE patch = 3; \
                 UPDATE relations SET x_m = x_m + 1 WHERE relation = 2; \
                 UPDATE changes SET payload = x'0100' WHERE change = (SELECT max(change) FROM changes)";
    database.execute_batch(spoil).unwrap();
    database.close().unwrap();
    let refused = read(&file).unwrap_err().to_string();
    for part in ["damaged", "scans", "relations", "salvage"] {
        assert!(refused.contains(part), "{part} missing in {refused}");
    }
    let salvaged = salvage(&file).unwrap();
    let lost: Vec<_> = salvaged.lost.iter().map(|finding| finding.place.as_str()).collect();
    assert_eq!(lost, ["scans", "changes"], "{salvaged:?}");
    let map = &salvaged.site.manifold;
    assert!(map.patches()[3].left_out && map.patches()[3].scan.is_empty());
    assert_eq!(map.relations()[2], expected.manifold.relations()[2]);
    assert_eq!(map.patches().len(), expected.manifold.patches().len());
    let new = scratch.at("new.manifold");
    salvaged.write(&new, "test", 5).unwrap();
    assert_same(&read(&new).unwrap().site, &salvaged.site);
    assert_eq!(verify(&new).unwrap(), []);
    let again = salvage(&new).unwrap();
    assert!(again.lost.is_empty() && again.repaired.is_empty(), "{again:?}");
    assert_same(&again.site, &salvaged.site);
}

#[test]
fn other_files_are_refused_with_the_reason() {
    let scratch = Scratch::new("foreign");
    let (file, ..) = written(&scratch);
    let spoil = |name: &str, sql: &str| {
        let copy = scratch.at(name);
        std::fs::copy(&file, &copy).unwrap();
        rusqlite::Connection::open(&copy).unwrap().execute_batch(sql).unwrap();
        copy
    };
    let text = scratch.at("text");
    std::fs::write(&text, "no database\n".repeat(40)).unwrap();
    let empty = scratch.at("empty");
    std::fs::write(&empty, "").unwrap();
    let other = scratch.at("other");
    rusqlite::Connection::open(&other).unwrap().execute_batch("CREATE TABLE t (x)").unwrap();
    let next = SCHEMA_VERSION + 1;
    let newer = format!(
        "INSERT INTO versions VALUES ({next}, '9.9.9', 0, 0); PRAGMA user_version = {next}"
    );
    let cases = [
        (scratch.at("missing"), "No such file"),
        (scratch.at(""), "folder"),
        (text, "no SQLite database"),
        (empty, "empty"),
        (other, "application id 0x00000000"),
        (spoil("id", "PRAGMA application_id = 7"), "application id 0x00000007"),
        (spoil("newer", &newer), "manifoldslam 9.9.9 or newer"),
        (spoil("version", "PRAGMA user_version = 99"), "versions"),
        (spoil("trigger", "CREATE TRIGGER t AFTER INSERT ON scans BEGIN SELECT 1; END"), "trigger"),
        (spoil("dropped", "DROP TABLE ways"), "schema"),
        (spoil("row", "DELETE FROM relations WHERE relation = 1"), "relations"),
        (spoil("history", "DELETE FROM changes WHERE change = 7"), "chain breaks at change 7"),
        (spoil("tail", "DELETE FROM changes WHERE change > 40"), "changes: 41 of"),
    ];
    for (path, reason) in cases {
        let before = std::fs::read(&path).ok();
        for told in [
            read(&path).unwrap_err().to_string(),
            verify(&path).unwrap_err().to_string(),
            SqliteStore::open(&path, "test").unwrap_err().to_string(),
        ] {
            assert!(told.contains(reason), "{reason:?} missing in {told:?}");
            assert!(told.contains(&path.display().to_string()), "{told:?}");
        }
        assert!(std::fs::read(&path).ok() == before, "{} has changed", path.display());
    }
    // The index of places is not read on opening, but verified.
    let moved = spoil("moved", "UPDATE patch_places SET min_x_m = 7, max_x_m = 7 WHERE patch = 1");
    assert!(verify(&moved).unwrap()[0].to_string().contains("patch_places"));
}
