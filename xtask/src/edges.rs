use crate::runner::Run;
use anyhow::{Context, Result, bail};
use serde_json::Value;

/// The crates, lowest first, and the crates of ours that each may use. One way down; a new edge
/// needs an ADR. Dev-dependencies may use any crate of the list but the program.
const ALLOWED: &[(&str, &[&str])] = &[
    ("geometry", &[]),
    ("sensing", &["geometry"]),
    ("synthetic", &["geometry", "sensing"]),
    ("matching", &["geometry", "sensing"]),
    ("manifold", &["geometry", "sensing"]),
    ("optimizer", &["geometry"]),
    ("slam", &["geometry", "sensing", "matching", "manifold", "optimizer"]),
    ("rendering", &["geometry", "sensing"]),
    ("logs", &["geometry", "sensing", "optimizer"]),
    ("store", &["geometry", "sensing", "manifold"]),
    (
        PROGRAM,
        &[
            "geometry",
            "sensing",
            "synthetic",
            "matching",
            "manifold",
            "optimizer",
            "slam",
            "rendering",
            "logs",
            "store",
        ],
    ),
    ("xtask", &[]),
];
const PROGRAM: &str = "manifoldslam";
/// Crates from outside that only some of ours may use.
const RESTRICTED: &[(&str, &[&str])] =
    &[("anyhow", &[PROGRAM, "xtask"]), ("clap", &[PROGRAM]), ("indicatif", &[PROGRAM])];

/// Reads the manifests through cargo and refuses every other edge.
pub fn check(run: &mut Run) -> Result<()> {
    let mut wrong = Vec::new();
    for package in run.workspace.packages() {
        let name = short(package["name"].as_str().context("a package without name")?);
        let Some((_, allowed)) = ALLOWED.iter().find(|(known, _)| *known == name) else {
            wrong.push(format!("{name} is not in the list of crates"));
            continue;
        };
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            wrong.extend(objection(name, allowed, dependency));
        }
    }
    if !wrong.is_empty() {
        bail!("{}", wrong.join("\n"));
    }
    Ok(())
}

fn objection(name: &str, allowed: &[&str], dependency: &Value) -> Option<String> {
    let full = dependency["name"].as_str().unwrap_or_default();
    let other = short(full);
    let kind = dependency["kind"].as_str().unwrap_or("normal");
    let ours = dependency["path"].is_string();
    let refused = if ours && kind == "dev" {
        other == PROGRAM
    } else if ours {
        !allowed.contains(&other)
    } else {
        let list = RESTRICTED.iter().find(|(crate_name, _)| *crate_name == full);
        list.is_some_and(|(_, users)| kind == "normal" && !users.contains(&name))
    };
    refused.then(|| format!("{name} must not depend on {other} ({kind} dependency)"))
}

fn short(name: &str) -> &str {
    name.strip_prefix("manifoldslam-").unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_downwards() {
        let edge = |kind: Value| json!({"name": "manifoldslam-slam", "kind": kind, "path": "x"});
        assert!(objection("matching", &["geometry"], &edge(Value::Null)).is_some());
        assert!(objection("matching", &["geometry"], &edge(json!("dev"))).is_none());
        assert!(objection("manifoldslam", &["slam"], &edge(Value::Null)).is_none());
        let anyhow = json!({"name": "anyhow", "kind": null});
        assert!(objection("slam", &[], &anyhow).is_some());
        assert!(objection("xtask", &[], &anyhow).is_none());
    }
}
