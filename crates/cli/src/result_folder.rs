use crate::atomic::{PendingFile, beside};
use anyhow::{Context, Result, bail};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The file that tells a result folder from any other folder.
pub const METRICS: &str = "metrics.json";

/// The configuration of a run, as TOML.
pub const CONFIG: &str = "config.toml";
/// The manifold file of a result folder.
pub const SITE: &str = "site.manifold";

/// A result folder.
///
/// A new one is filled in place: its manifold file holds what is mapped at any moment, the other
/// files appear whole, and the figures last. One that replaces an older result is written into a
/// hidden folder beside it and takes its name when it is whole. Any other folder that is not empty
/// is refused.
#[derive(Debug)]
pub struct ResultFolder {
    target: PathBuf,
    /// The folder that is written to, the target itself where that is new.
    place: PathBuf,
    /// The place was there, empty, before.
    was_there: bool,
    /// What is in it must survive a failure.
    kept: bool,
    /// The files of trajectories in the result that is brought up to date.
    older_trajectories: BTreeSet<String>,
    written: RefCell<BTreeSet<String>>,
}

impl ResultFolder {
    /// Makes sure that `target` can be written, before any work is done.
    pub fn create(target: &Path) -> Result<Self> {
        check_replaceable(target)?;
        let cannot = || format!("{}: cannot create the result folder", target.display());
        if let Some(parent) = target.parent().filter(|p| !p.as_os_str().is_empty()) {
            fs::create_dir_all(parent).with_context(cannot)?;
        }
        let place = match is_empty(target) {
            true => target.to_owned(),
            false => beside(target, "partial")?,
        };
        let was_there = place.exists();
        fs::create_dir_all(&place).with_context(cannot)?;
        Self::writable(ResultFolder {
            target: target.to_owned(),
            place,
            was_there,
            kept: false,
            older_trajectories: BTreeSet::new(),
            written: RefCell::default(),
        })
    }

    /// A folder that has a result already, to be brought up to date in place.
    pub fn update(target: &Path) -> Result<Self> {
        Self::writable(ResultFolder {
            target: target.to_owned(),
            place: target.to_owned(),
            was_there: true,
            kept: true,
            older_trajectories: trajectories_of(target),
            written: RefCell::default(),
        })
    }

    /// A folder can be made where no file can be written, on a full disk for instance: it is tried.
    fn writable(folder: Self) -> Result<Self> {
        folder.write(".probe", b"manifoldslam")?;
        fs::remove_file(folder.path(".probe")).with_context(|| {
            format!("{}: cannot create the result folder", folder.target.display())
        })?;
        folder.written.take();
        Ok(folder)
    }

    /// The folder's name.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Where a file of the result is while it is written.
    pub fn path(&self, name: &str) -> PathBuf {
        self.place.join(name)
    }

    /// What is in the folder stays there whatever happens next.
    pub fn keep(&mut self) {
        self.kept = true;
    }

    /// Writes one file of the result; it is there whole or not at all.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        let cannot = || format!("{}: cannot write", self.target.join(name).display());
        self.written.borrow_mut().insert(name.to_owned());
        PendingFile::create(&self.path(name))
            .and_then(|file| file.commit(content))
            .with_context(cannot)
    }

    /// Gives the folder its name.
    pub fn commit(mut self) -> Result<()> {
        let cannot = || format!("{}: cannot replace", self.target.display());
        self.kept = true;
        if self.place == self.target {
            return self.remove_what_is_out_of_date();
        }
        let old = beside(&self.target, "old")?;
        fs::rename(&self.target, &old).with_context(cannot)?;
        if let Err(error) = fs::rename(&self.place, &self.target) {
            // Better the old result than none.
            let _ = fs::rename(&old, &self.target);
            return Err(error).with_context(cannot);
        }
        fs::remove_dir_all(&old).with_context(|| format!("{}: cannot remove", old.display()))
    }

    /// Removes the maps of islands that there are no more, and trajectories that the older result
    /// had and this one has not.
    fn remove_what_is_out_of_date(&self) -> Result<()> {
        let written = self.written.borrow();
        for entry in fs::read_dir(&self.place)? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            let is_ours = is_island_map(&name) || self.older_trajectories.contains(&name);
            if is_ours && !written.contains(&name) {
                fs::remove_file(self.path(&name))
                    .with_context(|| format!("{}: cannot remove", self.path(&name).display()))?;
            }
        }
        Ok(())
    }
}

impl Drop for ResultFolder {
    fn drop(&mut self) {
        if !self.kept {
            let _ = fs::remove_dir_all(&self.place);
            if self.was_there {
                let _ = fs::create_dir(&self.place);
            }
        }
    }
}

/// The folder that a file is in.
pub fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// True for two names of one folder.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| fs::canonicalize(path).ok();
    real(one).is_some() && real(one) == real(other)
}

/// The result folder that a manifold file belongs to, to be brought up to date with it.
pub fn result_folder_of(file: &Path) -> Result<Option<ResultFolder>> {
    let folder = folder_of(file);
    let named = file.file_name().is_some_and(|name| name == SITE);
    // The configuration is written first: it is there in a run that was interrupted.
    let is_result = [METRICS, CONFIG].iter().any(|name| folder.join(name).exists());
    Ok(match named && file.exists() && is_result {
        true => Some(ResultFolder::update(folder)?),
        false => None,
    })
}

/// The files of trajectories that a result folder names in its figures; none where it has no
/// figures, or such that this program did not write.
fn trajectories_of(folder: &Path) -> BTreeSet<String> {
    let figures = fs::read(folder.join(METRICS)).unwrap_or_default();
    let figures: serde_json::Value = serde_json::from_slice(&figures).unwrap_or_default();
    let logs = figures["logs"].as_array().into_iter().flatten();
    let all = logs.flat_map(|log| log["trajectories"].as_array().into_iter().flatten());
    all.filter_map(|track| track["file"].as_str().map(str::to_owned)).collect()
}

/// `map.pgm`, `map-2.png`, `map-level-0.png`, `map-2-level-0.png` and the like.
fn is_island_map(name: &str) -> bool {
    let Some((stem, ending)) = name.split_once('.') else { return false };
    let mut parts = stem.split('-').peekable();
    let is_number = |part: &&str| part.parse::<usize>().is_ok();
    let is_map = parts.next() == Some("map");
    parts.next_if(is_number);
    if parts.next_if_eq(&"level").is_some() && parts.next_if(is_number).is_none() {
        return false;
    }
    is_map && parts.next().is_none() && ["png", "pgm", "yaml"].contains(&ending)
}

/// True where there is nothing yet.
fn is_empty(target: &Path) -> bool {
    !target.exists() || fs::read_dir(target).is_ok_and(|mut entries| entries.next().is_none())
}

/// Refuses to replace what is not a result.
fn check_replaceable(target: &Path) -> Result<()> {
    if !target.exists() {
        return Ok(());
    }
    let mut entries = fs::read_dir(target)
        .with_context(|| format!("{}: not a folder that can be used", target.display()))?;
    // A run that was interrupted leaves a manifold file.
    let is_result = [METRICS, SITE].iter().any(|name| target.join(name).exists());
    if entries.next().is_some() && !is_result {
        bail!("{}: exists and is not an older result; choose another folder", target.display());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scratch(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("manifoldslam-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        path
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_result_appears_whole_or_not_at_all() {
        let place = scratch("whole");
        let target = place.join("deep/out");
        let folder = ResultFolder::create(&target).unwrap();
        folder.write(METRICS, b"1").unwrap();
        drop(folder);
        assert_eq!(names(&place.join("deep")), Vec::<String>::new());
        let mut folder = ResultFolder::create(&target).unwrap();
        folder.write(METRICS, b"1").unwrap();
        folder.keep();
        drop(folder);
        assert_eq!(names(&target), [METRICS]);
        let folder = ResultFolder::create(&target).unwrap();
        folder.write("other", b"2").unwrap();
        assert_eq!(names(&target), [METRICS]);
        drop(folder);
        assert_eq!(names(&place.join("deep")), ["out"]);
        let folder = ResultFolder::create(&target).unwrap();
        folder.write(METRICS, b"2").unwrap();
        folder.commit().unwrap();
        assert_eq!(names(&place.join("deep")), ["out"]);
        assert_eq!(names(&target), [METRICS]);
        fs::remove_dir_all(place).unwrap();
    }

    #[test]
    fn only_older_results_and_empty_folders_are_replaced() {
        let place = scratch("replace");
        let target = place.join("out");
        for (file, accepted) in [(None, true), (Some(METRICS), true), (Some("diary.txt"), false)] {
            fs::create_dir_all(&target).unwrap();
            if let Some(file) = file {
                fs::write(target.join(file), b"old").unwrap();
            }
            let failed = ResultFolder::create(&target);
            assert_eq!(failed.is_ok(), accepted, "{file:?}");
            drop(failed);
            assert_eq!(names(&target), file.into_iter().collect::<Vec<_>>(), "a run that failed");
            let folder = ResultFolder::create(&target);
            if let Ok(folder) = folder {
                folder.write("new", b"").unwrap();
                folder.commit().unwrap();
                assert_eq!(names(&target), ["new"]);
            }
            assert_eq!(names(&place), ["out"]);
            fs::remove_dir_all(&target).unwrap();
        }
        fs::write(&target, b"a file").unwrap();
        assert!(ResultFolder::create(&target).is_err());
        fs::remove_dir_all(place).unwrap();
    }
}
