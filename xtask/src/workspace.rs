use crate::cargo;
use anyhow::{Context, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Where things are, and what `cargo metadata` says of them.
pub struct Workspace {
    /// The folder of the workspace's Cargo.toml.
    pub root: PathBuf,
    /// Where cargo builds.
    pub target: PathBuf,
    /// Output of `cargo metadata --no-deps`.
    pub metadata: Value,
}

impl Workspace {
    /// Asks cargo.
    pub fn load() -> Result<Self> {
        let text = cargo::output(&["metadata", "--format-version=1", "--no-deps", "--locked"])?;
        let metadata: Value = serde_json::from_str(&text).context("cargo metadata")?;
        let path = |key: &str| metadata[key].as_str().map(PathBuf::from).context(key.to_owned());
        Ok(Workspace { root: path("workspace_root")?, target: path("target_directory")?, metadata })
    }

    /// The release build of the program.
    pub fn program(&self) -> PathBuf {
        self.target.join("release").join(format!("manifoldslam{}", std::env::consts::EXE_SUFFIX))
    }

    /// The packages of the workspace.
    pub fn packages(&self) -> impl Iterator<Item = &Value> {
        self.metadata["packages"].as_array().into_iter().flatten()
    }

    /// All text files with one of these endings, outside build and version control folders; sorted.
    pub fn files(&self, endings: &[&str]) -> Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        let mut folders = vec![self.root.clone()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).context(folder.display().to_string())? {
                let path = entry?.path();
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                if path.is_symlink() {
                    continue;
                } else if path.is_dir() {
                    let skipped = ["target", ".git", "node_modules"].contains(&name.as_str());
                    if !skipped && path != self.target {
                        folders.push(path);
                    }
                } else if endings.iter().any(|ending| name.ends_with(ending)) {
                    found.push(path);
                }
            }
        }
        found.sort();
        Ok(found)
    }

    /// A path as people in the workspace write it.
    pub fn relative<'a>(&self, path: &'a Path) -> std::path::Display<'a> {
        path.strip_prefix(&self.root).unwrap_or(path).display()
    }
}
