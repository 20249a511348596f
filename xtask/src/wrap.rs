use crate::source::COMMENT_COLUMNS;
use crate::workspace::Workspace;
use anyhow::{Context, Result};
use std::process::ExitCode;

/// Breaks all comment lines that are too long; stable rustfmt leaves comments alone.
pub fn run() -> ExitCode {
    match wrap_all() {
        Ok(count) => {
            println!("{count} files changed");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

fn wrap_all() -> Result<usize> {
    let workspace = Workspace::load()?;
    let mut count = 0;
    for path in &workspace.files(&[".rs"])? {
        let text = std::fs::read_to_string(path).context(path.display().to_string())?;
        let wrapped = wrap(&text);
        if wrapped != text {
            std::fs::write(path, wrapped).context(path.display().to_string())?;
            count += 1;
        }
    }
    Ok(count)
}

/// Moves the words that do not fit to the beginning of the next line of the same comment.
fn wrap(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut carried: Option<(String, String)> = None;
    let mut verbatim = false;
    for line in text.lines() {
        let (prefix, words) = comment(line).unwrap_or(("", ""));
        verbatim ^= words.starts_with("```");
        // A list item or a heading begins a line of its own.
        let opens = words.is_empty() || list_mark(words) > 0 || words.starts_with(['#', '|', '`']);
        let mut current = line.to_owned();
        if let Some((old_prefix, rest)) = carried.take() {
            if prefix == old_prefix && !opens && !verbatim {
                current = format!("{prefix}{rest} {words}");
            } else {
                push(&mut out, &format!("{old_prefix}{rest}"));
            }
        }
        let plain = verbatim || prefix.is_empty() || words.starts_with('|') || line.contains("://");
        match if plain { None } else { split(&current, prefix) } {
            Some((head, rest)) => {
                push(&mut out, &head);
                let hanging = " ".repeat(list_mark(&current[prefix.len()..]));
                carried = Some((format!("{prefix}{hanging}"), rest));
            }
            None => push(&mut out, &current),
        }
    }
    if let Some((prefix, rest)) = carried {
        push(&mut out, &format!("{prefix}{rest}"));
    }
    out
}

fn push(out: &mut String, line: &str) {
    out.push_str(line);
    out.push('\n');
}

/// Indentation with comment mark and blanks, and the text of a line that is nothing but comment.
fn comment(line: &str) -> Option<(&str, &str)> {
    let start = line.len() - line.trim_start().len();
    let mark = ["/// ", "//! ", "// "].into_iter().find(|mark| line[start..].starts_with(mark))?;
    let text = line[start + mark.len()..].trim_start();
    Some(line.split_at(line.len() - text.len()))
}

/// Length of the mark that begins a list item, such as `- ` or `2. `; 0 elsewhere.
fn list_mark(words: &str) -> usize {
    let digits = words.len() - words.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    if words.starts_with("- ") || words.starts_with("* ") {
        2
    } else if digits > 0 && words[digits..].starts_with(". ") {
        digits + 2
    } else {
        0
    }
}

/// A line that is too long, broken at its last blank that fits.
fn split(line: &str, prefix: &str) -> Option<(String, String)> {
    let limit = line.char_indices().nth(COMMENT_COLUMNS)?.0;
    let at = line[..=limit.min(line.len() - 1)].rfind(' ').filter(|at| *at > prefix.len())?;
    Some((line[..at].to_owned(), line[at + 1..].trim_start().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_move_to_the_next_line() {
        let word = "word ".repeat(25);
        let text = format!("    /// {}\n    /// and on.\n    fn f();\n", word.trim_end());
        let wrapped = wrap(&text);
        assert!(wrapped.lines().all(|l| l.chars().count() <= COMMENT_COLUMNS), "{wrapped}");
        let words = |t: &str| {
            t.replace("///", "").split_whitespace().map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(words(&wrapped), words(&text));
        assert_eq!(wrapped.lines().count(), 3, "{wrapped}");
        assert_eq!(wrap(&wrapped), wrapped);
    }

    #[test]
    fn list_items_hang() {
        let word = "word ".repeat(25);
        let text = format!("//! 2. {}\n//!    end.\n//! 3. next\n", word.trim_end());
        let wrapped = wrap(&text);
        let lines: Vec<&str> = wrapped.lines().collect();
        assert!(
            lines[1].starts_with("//!    word") && lines[1].ends_with("word end."),
            "{wrapped}"
        );
        assert_eq!((lines.len(), lines[2]), (3, "//! 3. next"));
    }
}
