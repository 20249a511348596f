//! Files of every version open forever.

use crate::sites::{Scratch, assert_same, site_of, story};
use manifoldslam_store::{SCHEMA_VERSION, SqliteStore, Store, read, verify};
use std::io::Read;
use std::path::{Path, PathBuf};

/// The fixture of a version, unpacked.
fn fixture(scratch: &Scratch, version: i64) -> PathBuf {
    let packed = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("tests/fixtures/version-{version}.manifold.gz"));
    let packed = std::fs::File::open(packed).unwrap();
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(packed).read_to_end(&mut bytes).unwrap();
    let file = scratch.at(&format!("version-{version}.manifold"));
    std::fs::write(&file, bytes).unwrap();
    file
}

#[test]
fn files_of_all_versions_open() {
    let scratch = Scratch::new("versions");
    for version in 1..=SCHEMA_VERSION {
        let (mut steps, _) = story(30);
        if version < 3 {
            steps[..12].iter_mut().for_each(|step| step.observations.clear());
        }
        let file = fixture(&scratch, version);
        let bytes = std::fs::read(&file).unwrap();
        let found = read(&file).unwrap();
        let mut versions: Vec<_> = (1..=version).map(|v| (v, "fixture".to_owned())).collect();
        assert_eq!(found.versions, versions);
        assert_same(&found.site, &site_of(&steps[..12]));
        assert_eq!(verify(&file).unwrap(), []);
        assert!(std::fs::read(&file).unwrap() == bytes, "reading has changed the file");

        let mut store = SqliteStore::open(&file, "later").unwrap();
        steps[12..].iter().for_each(|step| store.write(step).unwrap());
        store.close().unwrap();
        let found = read(&file).unwrap();
        assert_same(&found.site, &site_of(&steps));
        versions.extend((version + 1..=SCHEMA_VERSION).map(|v| (v, "later".to_owned())));
        assert_eq!(found.versions, versions);
        assert_eq!(verify(&file).unwrap(), []);
    }
}
