/// A table that can be printed or written as Markdown. The first column is text, the others are
/// figures.
pub struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these columns.
    pub fn new<S: Into<String>>(header: impl IntoIterator<Item = S>) -> Self {
        Table { header: header.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// With aligned columns, for a terminal.
    pub fn to_text(&self) -> String {
        let widths = self.widths();
        let mut text = String::new();
        for row in std::iter::once(&self.header).chain(&self.rows) {
            text.push_str(format!("  {}", line(row, &widths, "  ")).trim_end());
            text.push('\n');
        }
        text
    }

    /// As Markdown, readable as it stands.
    pub fn to_markdown(&self) -> String {
        let widths: Vec<usize> = self.widths().into_iter().map(|w| w.max(3)).collect();
        let mut text = format!("| {} |\n|", line(&self.header, &widths, " | "));
        for (k, width) in widths.iter().enumerate() {
            let dashes = "-".repeat(width + 1);
            text.push_str(&if k == 0 { format!("{dashes}-|") } else { format!("{dashes}:|") });
        }
        text.push('\n');
        for row in &self.rows {
            text.push_str(&format!("| {} |\n", line(row, &widths, " | ")));
        }
        text
    }

    fn widths(&self) -> Vec<usize> {
        let columns = 0..self.header.len();
        let width = |k: usize| {
            let cells =
                std::iter::once(&self.header).chain(&self.rows).filter_map(|row| row.get(k));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        columns.map(width).collect()
    }
}

fn line(row: &[String], widths: &[usize], between: &str) -> String {
    let cell = |(k, (cell, width)): (usize, (&String, &usize))| match k {
        0 => format!("{cell:<width$}"),
        _ => format!("{cell:>width$}"),
    };
    row.iter().zip(widths).enumerate().map(cell).collect::<Vec<_>>().join(between)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let mut table = Table::new(["name", "x"]);
        table.row(["a".into(), "1.25".into()]);
        assert_eq!(table.to_text(), "  name     x\n  a     1.25\n");
        let expected = "| name |    x |\n|------|-----:|\n| a    | 1.25 |\n";
        assert_eq!(table.to_markdown(), expected);
    }
}
