//! The manifold file, `site.manifold`: a map on disk, written step by step, whole at any moment.
//!
//! A file is an SQLite database. It holds the journal of [`manifold::Change`]s, from which the map
//! can be rebuilt, and beside it the present state in tables that any SQLite tool can read: robots
//! with their logs and trajectories, patches, relations, ways, sightings, scans. Every step is one
//! transaction. Every row carries a checksum, every table a digest, and the journal is chained, so
//! that damage is found on opening and never becomes another map. This crate does IO on its file
//! and on nothing else; it reads no clock. See `docs/manifold-file.md`.
//!
//! ```
//! use manifoldslam_store::{SqliteStore, Step, Store, read};
//! # let folder = std::env::temp_dir().join(format!("store-example-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! let file = folder.join("site.manifold");
//! # let _ = std::fs::remove_file(&file);
//! let mut map = manifold::Manifold::new();
//! map.add_robot("alice");
//! let mut store = SqliteStore::create(&file, "0.1.0")?;
//! store.write(&Step { changes: map.take_journal(), ..Step::default() })?;
//! store.close()?;
//! assert_eq!(read(&file)?.site.manifold.robots(), map.robots());
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cells;
mod checksum;
mod connecting;
mod content_hash;
mod error;
mod journal;
mod ledger;
mod loading;
mod lock;
mod observations;
mod places;
mod recorder;
mod rows;
mod salvage;
mod scan_codec;
mod schema;
mod site;
mod sqlite;
mod store;
mod table;
mod writing;

pub use content_hash::ContentHash;
pub use error::{Finding, StoreError};
pub use loading::same_map;
pub use observations::{ObservationBlock, TakenScan};
pub use recorder::{COMMIT_EVERY, Recorder};
pub use rows::provenance_name;
pub use salvage::{Salvaged, salvage};
pub use schema::SCHEMA_VERSION;
pub use site::{RobotLog, Site, Step, StepSummary, TrackedScan, changes_of};
pub use sqlite::{SiteFile, SqliteStore, read, verify};
pub use store::Store;
