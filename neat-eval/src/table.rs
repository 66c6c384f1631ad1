//! Tables for people: aligned text, and Markdown.

use std::fmt::Write;

/// A table with a title and a header.
pub(crate) struct Table {
    pub title: String,
    pub header: Vec<String>,
    /// As many cells as the header in every row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new(title: impl Into<String>, header: &[&str]) -> Self {
        Self {
            title: title.into(),
            header: header.iter().map(|cell| (*cell).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// One row for each name with its value.
    pub(crate) fn of_values<'a>(
        title: impl Into<String>,
        header: [&str; 2],
        values: impl IntoIterator<Item = (&'a str, String)>,
    ) -> Self {
        let rows = values
            .into_iter()
            .map(|(name, value)| vec![name.into(), value]);
        Self {
            rows: rows.collect(),
            ..Self::new(title, &header)
        }
    }

    /// Columns apart by two spaces, numbers to the right.
    pub(crate) fn to_text(&self) -> String {
        let widths = self.widths();
        let mut text = format!("{}\n", self.title);
        for row in std::iter::once(&self.header).chain(&self.rows) {
            let mut line = String::new();
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                let _ = match column {
                    0 => write!(line, "  {cell:<width$}"),
                    _ => write!(line, "  {cell:>width$}"),
                };
            }
            text += line.trim_end();
            text.push('\n');
        }
        text
    }

    /// A Markdown table with padded cells.
    pub(crate) fn to_markdown(&self) -> String {
        let widths = self.widths();
        let rule: Vec<String> = widths
            .iter()
            .enumerate()
            .map(|(column, width)| match column {
                0 => "-".repeat(*width),
                _ => format!("{}:", "-".repeat(width - 1)),
            })
            .collect();
        let mut text = format!("{}\n\n", self.title);
        for row in [&self.header, &rule].into_iter().chain(&self.rows) {
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                let _ = match column {
                    0 => write!(text, "| {cell:<width$} "),
                    _ => write!(text, "| {cell:>width$} "),
                };
            }
            text += "|\n";
        }
        text
    }

    /// Of every column, at least two for a rule with its colon.
    fn widths(&self) -> Vec<usize> {
        (0..self.header.len())
            .map(|column| {
                let rows = std::iter::once(&self.header).chain(&self.rows);
                let widths = rows.map(|row| row[column].chars().count());
                widths.max().unwrap_or(0).max(2)
            })
            .collect()
    }
}

/// A distance with four digits; a dash for none.
pub(crate) fn distance(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.4}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let mut table = Table::new("Distances", &["of", "mean"]);
        table.rows.push(vec!["junctions".into(), "1.5".into()]);
        assert_eq!(
            table.to_text(),
            "Distances\n  of         mean\n  junctions   1.5\n"
        );
        assert_eq!(
            table.to_markdown(),
            "Distances\n\n| of        | mean |\n| --------- | ---: |\n| junctions |  1.5 |\n"
        );
    }
}
