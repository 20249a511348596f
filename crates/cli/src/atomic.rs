use anyhow::{Context, Result, bail};
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A path beside `target` that no other process uses, hidden.
pub fn beside(target: &Path, purpose: &str) -> Result<PathBuf> {
    let Some(name) = target.file_name() else {
        bail!("{}: not a name to write to", target.display());
    };
    let name = format!(".{}.{purpose}-{}", name.to_string_lossy(), std::process::id());
    Ok(target.with_file_name(name))
}

/// A file that appears under its name only when it is whole.
///
/// Creating one shows early whether the place can be written; dropping it leaves nothing behind.
#[derive(Debug)]
pub struct PendingFile {
    target: PathBuf,
    temporary: PathBuf,
}

impl PendingFile {
    /// Makes sure that `target` can be written.
    pub fn create(target: &Path) -> Result<Self> {
        if target.is_dir() {
            bail!("{}: is a folder", target.display());
        }
        let temporary = beside(target, "partial")?;
        fs::write(&temporary, b"")
            .with_context(|| format!("{}: cannot write", target.display()))?;
        Ok(PendingFile { target: target.to_owned(), temporary })
    }

    /// Opens the file for writing piece by piece; [`PendingFile::publish`] gives it its name.
    pub fn writer(&self) -> Result<BufWriter<File>> {
        let file = File::create(&self.temporary)
            .with_context(|| format!("{}: cannot write", self.target.display()))?;
        Ok(BufWriter::new(file))
    }

    /// Gives the file its name as it is; its writer must have been flushed.
    pub fn publish(self) -> Result<()> {
        fs::rename(&self.temporary, &self.target)
            .with_context(|| format!("{}: cannot write", self.target.display()))
    }

    /// Writes the whole content and gives the file its name.
    pub fn commit(self, content: &[u8]) -> Result<()> {
        fs::write(&self.temporary, content)
            .and_then(|()| fs::rename(&self.temporary, &self.target))
            .with_context(|| format!("{}: cannot write", self.target.display()))
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        // Gone already after a commit.
        let _ = fs::remove_file(&self.temporary);
    }
}
