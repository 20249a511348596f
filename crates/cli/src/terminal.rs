use crate::args::Global;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, IsTerminal, Write};

/// A progress bar on standard error, hidden where nobody watches.
pub fn progress(global: &Global, length: u64, template: &str) -> ProgressBar {
    if global.quiet || !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// Prints a command's result: JSON where asked for, else text unless quiet.
pub fn print(global: &Global, text: &str, json: &impl Serialize) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    if global.json {
        serde_json::to_writer_pretty(&mut out, json)?;
        writeln!(out)?;
    } else if !global.quiet {
        writeln!(out, "{}", text.trim_end())?;
    }
    Ok(())
}

/// A whole number with separators: 13,631.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `count thing` or `count things`.
pub fn counted(count: u64, thing: &str) -> String {
    format!("{} {thing}{}", grouped(count), if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped() {
        let cases = [(0, "0"), (999, "999"), (1000, "1,000"), (1_234_567, "1,234,567")];
        for (number, text) in cases {
            assert_eq!(grouped(number), text);
        }
        assert_eq!((counted(1, "line"), counted(2, "line")), ("1 line".into(), "2 lines".into()));
    }
}
