//! A summary as files: `summary.json`, and tables for people (`.md`) and programs
//! (`.csv`).

use crate::batch::Batch;
use crate::error::BatchError;
use crate::job_record::JobState;
use crate::json_file;
use crate::summary::{Aggregate, JobSummary, Summary};
use neat_core::{SceneError, file};
use std::fmt::Write;
use std::fs::OpenOptions;
use std::path::Path;

impl Summary {
    /// [`Self::read`], and writes `summary.json`, `summary.md` and `summary.csv`. Of
    /// several processes that do so, the last one has seen the work of all.
    ///
    /// # Errors
    /// If `out` cannot be written.
    pub fn write(batch: &Batch, out: &Path) -> Result<Self, BatchError> {
        file::create_dir(out)?;
        let path = out.join(".summary.lock");
        let locked = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .and_then(|file| file.lock().map(|()| file));
        // Held until the end of the function.
        let _lock = locked.map_err(|source| SceneError::Write { path, source })?;
        let summary = Self::read(batch, out);
        json_file::write(&out.join("summary.json"), "summary of a batch", &summary)?;
        file::write_atomically(&out.join("summary.md"), to_markdown(&summary).as_bytes())?;
        file::write_atomically(&out.join("summary.csv"), to_csv(&summary).as_bytes())?;
        Ok(summary)
    }
}

/// A column of numbers.
struct Column {
    /// In the table for people.
    title: &'static str,
    /// In the table for programs.
    key: &'static str,
    digits: usize,
    /// The number for people is so many times the one for programs.
    factor: f64,
    value: fn(&Aggregate) -> Option<f64>,
}

const COLUMNS: [Column; 9] = [
    column("time s", "seconds", 1, |row| row.seconds),
    column("junctions", "junctions", 0, |row| row.junctions),
    column("edges", "edges", 0, |row| row.edges),
    Column {
        factor: 100.0,
        ..column("explained %", "explained_length_share", 1, |row| {
            row.explained_length_share
        })
    },
    column("off px", "mean_reprojection_error_in_pixels", 2, |row| {
        row.mean_reprojection_error_in_pixels
    }),
    column("J precision", "junction_precision", 3, |row| {
        row.junction_precision
    }),
    column("J recall", "junction_recall", 3, |row| row.junction_recall),
    column("S precision", "segment_precision", 3, |row| {
        row.segment_precision
    }),
    column("S recall", "segment_recall", 3, |row| row.segment_recall),
];

const fn column(
    title: &'static str,
    key: &'static str,
    digits: usize,
    value: fn(&Aggregate) -> Option<f64>,
) -> Column {
    Column {
        title,
        key,
        digits,
        factor: 1.0,
        value,
    }
}

impl Column {
    fn for_people(&self, row: &Aggregate, extra_digits: usize) -> String {
        let digits = self.digits + extra_digits;
        let value = (self.value)(row).map(|value| value * self.factor);
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    }
}

/// The summary for people: counts, a table without columns that are empty, and the
/// failures with their reasons.
pub fn to_markdown(summary: &Summary) -> String {
    let rows: Vec<Aggregate> = summary.jobs.iter().map(JobSummary::row).collect();
    let columns: Vec<&Column> = COLUMNS
        .iter()
        .filter(|column| rows.iter().any(|row| (column.value)(row).is_some()))
        .collect();
    let mut text = counts(summary) + "\n\n";
    let mut line = |cells: Vec<String>| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    };
    let titles = columns.iter().map(|column| column.title);
    let titles = ["job", "state", "attempts"].into_iter().chain(titles);
    line(titles.map(str::to_owned).collect());
    let rules = ["---", "---", "--:"].into_iter();
    let rules = rules.chain(columns.iter().map(|_| "--:"));
    line(rules.map(str::to_owned).collect());
    for (job, row) in summary.jobs.iter().zip(&rows) {
        let words = [
            in_a_cell(&job.name),
            job.state.to_string(),
            job.attempts.to_string(),
        ];
        let numbers = columns.iter().map(|column| column.for_people(row, 0));
        line(words.into_iter().chain(numbers).collect());
    }
    if summary.totals.finished > 1 {
        let totals = &summary.totals;
        for (name, row) in [("mean", &totals.means), ("median", &totals.medians)] {
            let words = [format!("*{name}*"), "finished".to_owned(), String::new()];
            // Those of counts need not be whole.
            let numbers = columns.iter().map(|column| column.for_people(row, 1));
            line(words.into_iter().chain(numbers).collect());
        }
    }
    if columns
        .iter()
        .any(|column| column.key == "junction_precision")
    {
        text += "\nJ and S: junctions and segments (by the larger end distance) against the true wireframe at 0.01, `neat-abc`.\n";
    }
    let errors = summary
        .jobs
        .iter()
        .filter_map(|job| Some((job, job.error.as_ref()?)));
    for (position, (job, error)) in errors.enumerate() {
        if position == 0 {
            text += "\n";
        }
        let words = error.split_whitespace().collect::<Vec<_>>().join(" ");
        let _ = writeln!(text, "- {}: {words} (see {}/log.txt)", job.name, job.name);
    }
    text
}

/// How many jobs are in which state.
fn counts(summary: &Summary) -> String {
    let all = summary.jobs.len();
    let mut text = format!("{} of {all} jobs finished", summary.totals.finished);
    let others = JobState::ALL.iter().rev();
    for &state in others.filter(|&&state| state != JobState::Finished) {
        let count = summary.totals.count(state);
        if count > 0 {
            let _ = write!(text, ", {count} {state}");
        }
    }
    text
}

/// The summary for programs: all columns, texts in quotes.
pub fn to_csv(summary: &Summary) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let keys = COLUMNS.iter().map(|column| column.key);
    let head = ["job", "scene", "state", "attempts"].into_iter();
    let head: Vec<&str> = head.chain(keys).chain(["error"]).collect();
    let mut text = head.join(",") + "\n";
    for job in &summary.jobs {
        let row = job.row();
        let mut cells = vec![
            quoted(&job.name),
            quoted(&job.scene.to_string_lossy()),
            quoted(&job.state.to_string()),
            job.attempts.to_string(),
        ];
        let numbers = COLUMNS.iter().map(|column| (column.value)(&row));
        cells
            .extend(numbers.map(|value| value.map_or_else(String::new, |value| value.to_string())));
        cells.push(quoted(job.error.as_deref().unwrap_or_default()));
        text += &(cells.join(",") + "\n");
    }
    text
}

/// A text that neither ends its cell nor its row.
fn in_a_cell(text: &str) -> String {
    text.replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result_files::ResultFigures;
    use crate::summary::Totals;

    fn summary() -> Summary {
        let finished = |name: &str, edges| JobSummary {
            name: name.into(),
            scene: "/scenes/a".into(),
            state: JobState::Finished,
            attempts: 1,
            seconds: 12.34,
            figures: Some(ResultFigures {
                junctions: 12,
                edges,
                explained_length_share: Some(0.9876),
                ..ResultFigures::default()
            }),
            ..JobSummary::default()
        };
        let failed = JobSummary {
            name: "c".into(),
            state: JobState::Failed,
            attempts: 3,
            seconds: 1.0,
            error: Some("exit code 1: a \"b\"\n| c".into()),
            ..JobSummary::default()
        };
        let means = Aggregate {
            edges: Some(18.5),
            ..Aggregate::default()
        };
        Summary {
            totals: Totals {
                finished: 2,
                failed: 1,
                means,
                ..Totals::default()
            },
            jobs: vec![finished("a", 18), finished("b", 19), failed],
        }
    }

    #[test]
    fn people_see_columns_with_numbers_and_every_failure() {
        let text = to_markdown(&summary());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "2 of 3 jobs finished, 1 failed");
        assert_eq!(
            lines[2],
            "| job | state | attempts | time s | junctions | edges | explained % |"
        );
        assert_eq!(lines[4], "| a | finished | 1 | 12.3 | 12 | 18 | 98.8 |");
        assert_eq!(lines[6], "| c | failed | 3 | 1.0 | - | - | - |");
        assert_eq!(lines[7], "| *mean* | finished |  | - | - | 18.5 | - |");
        let last = "- c: exit code 1: a \"b\" | c (see c/log.txt)";
        assert_eq!(lines.last(), Some(&last));
    }

    #[test]
    fn programs_get_all_columns() {
        let text = to_csv(&summary());
        let mut lines = text.lines();
        assert_eq!(lines.next().unwrap().split(',').count(), COLUMNS.len() + 5);
        let first = "\"a\",\"/scenes/a\",\"finished\",1,12.34,12,18,0.9876,,,,,,\"\"";
        assert_eq!(lines.next(), Some(first));
        assert!(
            text.ends_with(",\"exit code 1: a \"\"b\"\"\n| c\"\n"),
            "{text}"
        );
    }
}
