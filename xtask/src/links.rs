use crate::runner::Run;
use anyhow::{Context, Result, bail};
use std::path::Path;

/// Documents that a reader expects at the root.
const DOCUMENTS: [&str; 5] =
    ["README.md", "ARCHITECTURE.md", "TERMINOLOGY.md", "CONTRIBUTING.md", "CHANGELOG.md"];

/// Relative links in Markdown lead somewhere; the documents exist; the change log knows this
/// version.
pub fn check(run: &mut Run) -> Result<()> {
    let workspace = &run.workspace;
    let mut wrong: Vec<String> = DOCUMENTS
        .iter()
        .filter(|name| !workspace.root.join(name).is_file())
        .map(|name| format!("{name} is missing"))
        .collect();
    let mut count = 0;
    for path in workspace.files(&[".md"])? {
        let text = std::fs::read_to_string(&path).context(path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for (line, link) in links(&text) {
            count += 1;
            if !folder.join(&link).exists() {
                wrong.push(format!("{}:{line}: {link} leads nowhere", workspace.relative(&path)));
            }
        }
    }
    wrong.extend(change_log(workspace));
    run.note(format!("{count} links between documents followed"));
    if !wrong.is_empty() {
        bail!("{}", wrong.join("\n"));
    }
    Ok(())
}

fn change_log(workspace: &crate::workspace::Workspace) -> Option<String> {
    let text = std::fs::read_to_string(workspace.root.join("CHANGELOG.md")).ok()?;
    let version = workspace.packages().find_map(|p| p["version"].as_str())?;
    let headings = text.lines().filter(|line| line.starts_with("## "));
    let known = headings.into_iter().any(|h| h.contains(version) || h.contains("Unreleased"));
    (!known).then(|| format!("CHANGELOG.md has no heading for {version} and none `Unreleased`"))
}

/// Relative targets of `[text](target)`, with their lines; code is left out.
fn links(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut code = false;
    for (i, line) in text.lines().enumerate() {
        code ^= line.trim_start().starts_with("```");
        // Every second piece between back quotes is code.
        let prose =
            line.split('`').enumerate().map(|(k, piece)| if k % 2 == 0 { piece } else { "`" });
        let prose: String = if code { String::new() } else { prose.collect() };
        for (at, _) in prose.match_indices("](") {
            let rest = &prose[at + 2..];
            let target = rest.split([')', ' ', '#']).next().unwrap_or_default();
            let outside = target.contains("://") || target.starts_with("mailto:");
            if !target.is_empty() && !outside {
                found.push((i + 1, target.to_owned()));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_links_only() {
        let text =
            "[a](b.md#c) ![i](d.png) [w](https://x.org)\n```\n[x](code)\n```\n`[y](z)` [e](#f)";
        assert_eq!(links(text), [(1, "b.md".to_owned()), (1, "d.png".to_owned())]);
    }
}
