use crate::runner::Run;
use anyhow::{Context, Result, bail};

/// Longest line of comment, and of anything else that rustfmt leaves alone.
pub const COMMENT_COLUMNS: usize = 100;
const CODE_COLUMNS: usize = 120;
/// Longest function, from its name to its closing brace.
const FUNCTION_LINES: usize = 70;
/// Crates that neither read nor wait nor speak.
const CORE: [&str; 7] =
    ["geometry", "sensing", "matching", "manifold", "optimizer", "slam", "rendering"];
/// What the core must not name.
const FORBIDDEN_IN_CORE: [&str; 12] = [
    "std::fs",
    "std::net",
    "std::io",
    "std::env",
    "std::process",
    "std::thread",
    "SystemTime",
    "Instant",
    "ThreadPoolBuilder",
    "thread_rng",
    "println!",
    "dbg!",
];

/// Of these, what a crate must not name that does IO on files it is given, and nothing else.
const FORBIDDEN_BESIDE_FILES: [&str; 10] = [
    "std::net",
    "std::env",
    "std::process",
    "std::thread",
    "SystemTime",
    "Instant",
    "ThreadPoolBuilder",
    "thread_rng",
    "println!",
    "dbg!",
];
/// Crates that read and write files and neither wait nor speak.
const FILES_ONLY: [&str; 1] = ["store"];

/// Looks at the text of all sources.
pub fn check(run: &mut Run) -> Result<()> {
    let mut wrong = Vec::new();
    let endings = [".rs", ".md", ".toml", ".css", ".html", ".yaml", ".yml", ".sh", "run"];
    let files = run.workspace.files(&endings)?;
    for path in &files {
        let text = std::fs::read_to_string(path).context(path.display().to_string())?;
        let name = run.workspace.relative(path).to_string().replace('\\', "/");
        let mut object = |line: usize, what: String| wrong.push(format!("{name}:{line}: {what}"));
        machine_paths(&text, &mut object);
        if path.extension().is_some_and(|e| e == "rs") {
            widths(&text, &mut object);
            functions(&text, &mut object);
            if is_of(&CORE, &name) {
                quiet(&text, &FORBIDDEN_IN_CORE, &mut object);
            } else if is_of(&FILES_ONLY, &name) {
                quiet(&text, &FORBIDDEN_BESIDE_FILES, &mut object);
            }
        }
    }
    run.note(format!("{} source files looked at", files.len()));
    if !wrong.is_empty() {
        bail!("{}", wrong.join("\n"));
    }
    Ok(())
}

/// Library code of one of the crates, tests and examples excepted.
fn is_of(crates: &[&str], name: &str) -> bool {
    crates.iter().any(|krate| name.starts_with(&format!("crates/{krate}/src/")))
}

fn widths(text: &str, object: &mut impl FnMut(usize, String)) {
    for (i, line) in text.lines().enumerate() {
        let columns = line.chars().count();
        let limit =
            if line.trim_start().starts_with("//") { COMMENT_COLUMNS } else { CODE_COLUMNS };
        if columns > limit && !line.contains("://") {
            object(i + 1, format!("{columns} columns, at most {limit}"));
        }
    }
}

/// Relies on rustfmt: a function ends at the first `}` with the indentation of its `fn`.
fn functions(text: &str, object: &mut impl FnMut(usize, String)) {
    let lines: Vec<&str> = text.lines().collect();
    for (i, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let Some(name) = function_name(code) else { continue };
        let indent = &line[..line.len() - code.len()];
        let closes = |l: &&str| l.strip_prefix(indent).is_some_and(|rest| rest.starts_with('}'));
        let signature_only = code.ends_with(';') || code.ends_with('}');
        let length = lines[i..].iter().position(closes).map_or(1, |end| end + 1);
        if !signature_only && length > FUNCTION_LINES {
            object(i + 1, format!("fn {name} has {length} lines, at most {FUNCTION_LINES}"));
        }
    }
}

/// The name of the function that a line begins to define.
fn function_name(code: &str) -> Option<&str> {
    let (before, after) = code.split_once("fn ")?;
    let words = ["pub", "pub(crate)", "pub(super)", "const", "async", "unsafe", "extern"];
    before.split_whitespace().all(|word| words.contains(&word)).then(|| {
        let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
        &after[..end]
    })
}

/// Paths of somebody's machine.
fn machine_paths(text: &str, object: &mut impl FnMut(usize, String)) {
    let roots = ["work", "home", "root", "Users"].map(|root| format!("/{root}/"));
    for (i, line) in text.lines().enumerate() {
        for root in &roots {
            // A folder of that name inside another path is no machine path.
            let at_start = |at: usize| {
                !line[..at].ends_with(|c: char| c.is_alphanumeric() || ".-_}/".contains(c))
            };
            if line.match_indices(root.as_str()).any(|(at, _)| at_start(at)) {
                object(i + 1, format!("names a path of a machine: {root}"));
            }
        }
    }
}

fn quiet(text: &str, forbidden: &[&str], object: &mut impl FnMut(usize, String)) {
    let library = text.split("#[cfg(test)]").next().unwrap_or_default();
    for (i, line) in library.lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        for word in forbidden.iter().filter(|word| names(code, word)) {
            object(i + 1, format!("this crate must not use {word}"));
        }
    }
}

/// Does the code contain the word as a whole?
fn names(code: &str, word: &str) -> bool {
    code.match_indices(word).any(|(at, _)| {
        let part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
        !part(code[..at].chars().next_back()) && !part(code[at + word.len()..].chars().next())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objections(text: &str, check: impl Fn(&str, &mut dyn FnMut(usize, String))) -> Vec<usize> {
        let mut lines = Vec::new();
        check(text, &mut |line, _| lines.push(line));
        lines
    }

    #[test]
    fn long_functions_are_found() {
        let body = "        let x = 1;\n".repeat(70);
        let text = format!("impl A {{\n    pub(crate) const fn long(&self) {{\n{body}    }}\n}}\n");
        let found = |text: &str| objections(text, |t, mut o| functions(t, &mut o));
        assert_eq!(found(&text), [2]);
        assert!(found(&text.replace("    pub(crate) const fn long(&self)", "    loop")).is_empty());
        let short =
            "    fn declared(&self);\n".to_owned() + &text.replace("fn long", "struct Long");
        assert!(found(&short).is_empty());
    }

    #[test]
    fn machine_paths_are_found() {
        let found = |text: &str| objections(text, |t, mut o| machine_paths(t, &mut o));
        let path = format!("see {}home/me/x", '/');
        assert_eq!(found(&path), [1]);
        assert_eq!(found(&format!("a\n\"{}work/x\"", '/')), [2]);
        assert!(found("https://example.org/home/x and ../work/x").is_empty());
    }

    #[test]
    fn the_core_is_watched() {
        let found = |text: &str| objections(text, |t, mut o| quiet(t, &FORBIDDEN_IN_CORE, &mut o));
        assert_eq!(found("let t = Instant::now();\nuse std::fs;"), [1, 2]);
        assert!(
            objections("use std::fs; use std::time::SystemTime;", |t, mut o| {
                quiet(t, &FORBIDDEN_BESIDE_FILES, &mut o)
            })
            .len()
                == 1
        );
        assert!(
            found("// an Instant\nlet instantly = Instants;\n#[cfg(test)]\nprintln!()").is_empty()
        );
    }
}
