use super::incoming::{IncomingScan, preparing, read_options};
use crate::config::Config;
use crate::reading::Reading;
use anyhow::{Context, Result, bail};
use logs::{LandmarkTable, LogFile};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use store::ContentHash;

/// A log to be mapped.
#[derive(Clone, Debug)]
pub struct LogSource {
    /// The robot's name.
    pub name: String,
    /// Where the log is, or what messages call it.
    pub path: PathBuf,
    /// Its text, where it is not read from the file.
    text: Option<Vec<u8>>,
    /// See [`LogSource::content_hash`]; the log is read for it once.
    content_hash: OnceLock<String>,
}

impl LogSource {
    /// A log in a file.
    pub fn of_file(path: &Path) -> Self {
        let (name, path) = (stem(path), path.to_owned());
        LogSource { name, path, text: None, content_hash: OnceLock::new() }
    }

    /// A log in memory, under the name that messages call it.
    pub fn of_text(path: &Path, text: Vec<u8>) -> Self {
        LogSource { text: Some(text), ..Self::of_file(path) }
    }

    /// By what the log is known again, with the landmarks in a table beside it.
    pub fn content_hash(&self) -> Result<&str> {
        if let Some(known) = self.content_hash.get() {
            return Ok(known);
        }
        let mut hash = ContentHash::default();
        if let Some(text) = &self.text {
            hash = hash.update(text);
        } else {
            hash = hash_of_file(hash, &self.path)?;
            let table = LandmarkTable::path_beside(&self.path);
            hash = if table.is_file() { hash_of_file(hash, &table)? } else { hash };
        }
        Ok(self.content_hash.get_or_init(|| hash.to_text()))
    }

    /// Begins to read it.
    pub fn read(self, config: &Config) -> Result<Reading<IncomingScan>> {
        let options = read_options(config);
        if let Some(text) = self.text {
            return Reading::of_text(text, &self.path, options, preparing(config));
        }
        let file = LogFile::open(&self.path)?;
        Reading::of_file(file, &self.path, options, preparing(config))
    }
}

fn hash_of_file(mut hash: ContentHash, path: &Path) -> Result<ContentHash> {
    let cannot = || format!("{}: cannot read", path.display());
    let mut file = File::open(path).with_context(cannot)?;
    let mut piece = vec![0; 1 << 16];
    loop {
        match file.read(&mut piece).with_context(cannot)? {
            0 => return Ok(hash),
            count => hash = hash.update(&piece[..count]),
        }
    }
}

/// A log's name without folders and without the endings of logs and archives.
pub fn stem(log: &Path) -> String {
    let name = log.file_name().unwrap_or(log.as_os_str()).to_string_lossy();
    let mut stem = name.as_ref();
    for ending in [".bz2", ".gz", ".clf", ".log", ".txt", ".carmen"] {
        stem = stem.strip_suffix(ending).filter(|rest| !rest.is_empty()).unwrap_or(stem);
    }
    stem.to_owned()
}

/// Sorts logs by the names of their robots, so that the result does not depend on their order.
///
/// # Errors
/// Two logs of the same name: their results would have the same name too.
pub fn canonical(mut sources: Vec<LogSource>) -> Result<Vec<LogSource>> {
    sources.sort_by(|a, b| a.name.cmp(&b.name));
    for pair in sources.windows(2) {
        if pair[0].name == pair[1].name {
            bail!(
                "{} and {}: two logs of this name; rename one of them, for a robot is called what its \
                 log is called",
                pair[0].path.display(),
                pair[1].path.display()
            );
        }
    }
    if sources.len() > usize::from(u16::MAX) {
        bail!("{} logs are too many for one map", sources.len());
    }
    Ok(sources)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stems_lose_the_endings_of_logs_and_archives() {
        for (log, expected) in [
            ("data/intel.clf.bz2", "intel"),
            ("a.b.log.gz", "a.b"),
            ("plain", "plain"),
            (".clf", ".clf"),
            ("x.txt", "x"),
        ] {
            assert_eq!(stem(Path::new(log)), expected);
        }
    }
}
