use crate::atomic::beside;
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// The file that tells a result folder from any other folder.
pub const METRICS: &str = "metrics.json";

/// A result folder that appears under its name only when it is whole.
///
/// Files are written into a hidden folder beside the target; [`ResultFolder::commit`] renames it.
/// An older result of the same name is replaced in the same moment; any other folder that is not
/// empty is refused.
#[derive(Debug)]
pub struct ResultFolder {
    target: PathBuf,
    temporary: PathBuf,
}

impl ResultFolder {
    /// Makes sure that `target` can be written, before any work is done.
    pub fn create(target: &Path) -> Result<Self> {
        check_replaceable(target)?;
        let cannot = || format!("{}: cannot create the result folder", target.display());
        if let Some(parent) = target.parent().filter(|p| !p.as_os_str().is_empty()) {
            fs::create_dir_all(parent).with_context(cannot)?;
        }
        let temporary = beside(target, "partial")?;
        fs::create_dir_all(&temporary).with_context(cannot)?;
        let folder = ResultFolder { target: target.to_owned(), temporary };
        // A folder can be made where no file can be written, on a full disk for instance.
        folder.write(".probe", b"manifoldslam")?;
        fs::remove_file(folder.temporary.join(".probe")).with_context(cannot)?;
        Ok(folder)
    }

    /// Writes one file of the result.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        fs::write(self.temporary.join(name), content)
            .with_context(|| format!("{}: cannot write", self.target.join(name).display()))
    }

    /// Gives the folder its name.
    pub fn commit(self) -> Result<()> {
        let cannot = || format!("{}: cannot replace", self.target.display());
        if !self.target.exists() {
            return fs::rename(&self.temporary, &self.target).with_context(cannot);
        }
        let old = beside(&self.target, "old")?;
        fs::rename(&self.target, &old).with_context(cannot)?;
        if let Err(error) = fs::rename(&self.temporary, &self.target) {
            // Better the old result than none.
            let _ = fs::rename(&old, &self.target);
            return Err(error).with_context(cannot);
        }
        fs::remove_dir_all(&old).with_context(|| format!("{}: cannot remove", old.display()))
    }
}

impl Drop for ResultFolder {
    fn drop(&mut self) {
        // Gone already after a commit.
        let _ = fs::remove_dir_all(&self.temporary);
    }
}

/// Refuses to replace what is not a result.
fn check_replaceable(target: &Path) -> Result<()> {
    if !target.exists() {
        return Ok(());
    }
    let mut entries = fs::read_dir(target)
        .with_context(|| format!("{}: not a folder that can be used", target.display()))?;
    if entries.next().is_some() && !target.join(METRICS).exists() {
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
        assert!(!target.exists());
        drop(folder);
        assert_eq!(names(&place.join("deep")), Vec::<String>::new());
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
            let folder = ResultFolder::create(&target);
            assert_eq!(folder.is_ok(), accepted, "{file:?}");
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
