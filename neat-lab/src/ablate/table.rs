//! The table of an ablation, for people and for programs.

use serde::Serialize;
use std::fmt;
use std::fmt::Write;

/// One row of the table. Scores are `None` where there is no truth for them, and all
/// numbers where the variant failed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// The table of the paper, or the group, that the variant belongs to.
    pub table: String,
    /// What is different.
    pub variant: String,
    /// Seconds of training; `None` if the field is that of the unchanged run.
    pub training_seconds: Option<f64>,
    /// Seconds of distillation.
    pub distillation_seconds: Option<f64>,
    /// Number of junctions.
    pub junctions: Option<usize>,
    /// Number of segments.
    pub segments: Option<usize>,
    /// Precision of the junctions.
    pub junction_precision: Option<f64>,
    /// Recall of the junctions.
    pub junction_recall: Option<f64>,
    /// Precision of the segments, by the larger end distance; of a rendered scene the
    /// share of their length that lies on creases.
    pub segment_precision: Option<f64>,
    /// Recall of the segments; of a rendered scene the share of the creases' length.
    pub segment_recall: Option<f64>,
    /// Mean distance of the junctions from the surface, ACC-J.
    pub junction_accuracy: Option<f64>,
    /// Mean distance of the segments from the surface, ACC-L.
    pub segment_accuracy: Option<f64>,
    /// PSNR of rendered views, in decibels.
    pub psnr: Option<f64>,
    /// Share of the pixels outside of all attraction regions, "MR".
    pub mask_ratio: Option<f64>,
    /// Why the row is not like others.
    pub note: Option<Note>,
}

impl Row {
    /// Whether the variant could not be measured.
    pub fn failed(&self) -> bool {
        matches!(self.note, Some(Note::Failed(_)))
    }
}

/// Why a row is not like others.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Note {
    /// The variant changes nothing in this configuration: the numbers are those of
    /// the unchanged run.
    SameAsBase,
    /// It could not be measured, for this reason.
    Failed(String),
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SameAsBase => f.write_str("changes nothing here"),
            Self::Failed(reason) => write!(f, "failed: {reason}"),
        }
    }
}

/// The table for people. Columns that no row has are left out.
pub fn to_markdown(rows: &[Row]) -> String {
    let columns = shown_columns(rows);
    let mut text = String::new();
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    text.push_str(&line(columns.iter().map(|c| c.name.to_owned()).collect()));
    let rule = columns.iter().map(|c| if c.number { "--:" } else { "---" });
    text.push_str(&line(rule.map(str::to_owned).collect()));
    for row in rows {
        let cells = columns.iter().map(|column| (column.cell)(row));
        let cells = cells.map(|cell| cell.as_deref().map_or_else(|| "-".to_owned(), in_a_cell));
        text.push_str(&line(cells.collect()));
    }
    text
}

/// A text that neither ends its cell nor its row.
fn in_a_cell(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").replace('|', "\\|")
}

/// The table for programs: comma-separated, texts in quotes.
pub fn to_csv(rows: &[Row]) -> String {
    let mut text = String::new();
    let names: Vec<&str> = COLUMNS.iter().map(|column| column.name).collect();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{}", names.join(","));
    for row in rows {
        let cells: Vec<String> = COLUMNS
            .iter()
            .map(|column| {
                let cell = (column.cell)(row).unwrap_or_default();
                if column.number {
                    cell
                } else {
                    format!("\"{}\"", cell.replace('"', "\"\""))
                }
            })
            .collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

/// A column of the table.
struct Column {
    name: &'static str,
    number: bool,
    cell: fn(&Row) -> Option<String>,
}

const fn number(name: &'static str, cell: fn(&Row) -> Option<String>) -> Column {
    Column {
        name,
        number: true,
        cell,
    }
}

const fn words(name: &'static str, cell: fn(&Row) -> Option<String>) -> Column {
    Column {
        name,
        number: false,
        cell,
    }
}

const COLUMNS: [Column; 15] = [
    words("table", |row| Some(row.table.clone())),
    words("variant", |row| Some(row.variant.clone())),
    number("train s", |row| fixed(row.training_seconds, 1)),
    number("distil s", |row| fixed(row.distillation_seconds, 2)),
    number("junctions", |row| count(row.junctions)),
    number("segments", |row| count(row.segments)),
    number("J precision", |row| fixed(row.junction_precision, 3)),
    number("J recall", |row| fixed(row.junction_recall, 3)),
    number("S precision", |row| fixed(row.segment_precision, 3)),
    number("S recall", |row| fixed(row.segment_recall, 3)),
    number("ACC-J", |row| fixed(row.junction_accuracy, 5)),
    number("ACC-L", |row| fixed(row.segment_accuracy, 5)),
    number("PSNR dB", |row| fixed(row.psnr, 2)),
    number("mask ratio", |row| fixed(row.mask_ratio, 3)),
    words("note", |row| row.note.as_ref().map(ToString::to_string)),
];

fn count(value: Option<usize>) -> Option<String> {
    value.map(|value| value.to_string())
}

fn fixed(value: Option<f64>, digits: usize) -> Option<String> {
    value.map(|value| format!("{value:.digits$}"))
}

fn shown_columns(rows: &[Row]) -> Vec<&'static Column> {
    let has_cells = |column: &&Column| rows.iter().any(|row| (column.cell)(row).is_some());
    COLUMNS.iter().filter(has_cells).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row() -> Row {
        Row {
            table: "paper, table 2".into(),
            variant: "a \"b\"".into(),
            distillation_seconds: Some(0.5),
            junctions: Some(12),
            segments: Some(18),
            junction_precision: Some(1.0),
            mask_ratio: Some(0.9),
            ..Row::default()
        }
    }

    #[test]
    fn columns_without_numbers_are_left_out_of_the_table_for_people() {
        let text = to_markdown(&[row()]);
        assert_eq!(
            text.lines().next(),
            Some(
                "| table | variant | distil s | junctions | segments | J precision | mask ratio |"
            )
        );
        assert!(
            text.ends_with("| 0.50 | 12 | 18 | 1.000 | 0.900 |\n"),
            "{text}"
        );
    }

    #[test]
    fn the_table_for_programs_has_all_columns_and_quotes_texts() {
        let text = to_csv(&[row()]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0].split(',').count(), COLUMNS.len());
        assert_eq!(
            lines[1],
            "\"paper, table 2\",\"a \"\"b\"\"\",,0.50,12,18,1.000,,,,,,,0.900,\"\""
        );
    }

    #[test]
    fn a_variant_that_failed_has_a_row_with_its_reason() {
        let failed = Row {
            variant: "b".into(),
            note: Some(Note::Failed("a | b\nc".into())),
            ..Row::default()
        };
        assert!(failed.failed() && !row().failed());
        let rows = [row(), failed];
        let table = to_markdown(&rows);
        assert_eq!(table.lines().count(), 4);
        assert!(
            table.ends_with("|  | b | - | - | - | - | - | failed: a \\| b c |\n"),
            "{table}"
        );
        assert!(to_csv(&rows).ends_with(",\"failed: a | b\nc\"\n"));
    }
}
