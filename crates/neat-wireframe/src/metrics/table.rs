//! An evaluation as a Markdown table that is also readable as plain text.

use super::{Evaluation, Matching, PrecisionRecall, WireframeCounts};
use std::fmt::Write;

impl Evaluation {
    /// The evaluation as Markdown: sizes, precision (P) and recall (R) per
    /// threshold, accuracy and completeness. Columns are aligned, so that it
    /// reads well in a terminal. The text says how predictions were matched.
    pub fn to_markdown(&self) -> String {
        let mut text = format!("Wireframe: {}.\n", describe(&self.counts));
        if let Some(scores) = &self.wireframe {
            let matching = match scores.matching {
                Matching::MinimumSum => "one matching with the smallest sum of distances",
                Matching::PerThreshold => "the best matching per threshold",
            };
            let _ = writeln!(text, "Truth: {}; {matching}.\n", describe(&scores.truth));
            let mut header = vec![String::new()];
            header.extend(
                scores
                    .junctions
                    .iter()
                    .map(|s| format!("P {}", s.threshold)),
            );
            header.extend(
                scores
                    .junctions
                    .iter()
                    .map(|s| format!("R {}", s.threshold)),
            );
            text += &table(&[
                header,
                row("junctions", &scores.junctions),
                row("segments, larger end distance", &scores.segments_max),
                row("segments, mean end distance", &scores.segments_mean),
            ]);
        }
        if let Some(scores) = &self.surface {
            let distance = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| format!("{x:.4}"));
            text += "\n";
            text += &table(&[
                vec!["distance to the surface".into(), "mean".into()],
                vec![
                    "junctions (ACC-J)".into(),
                    distance(scores.junction_accuracy),
                ],
                vec!["segments (ACC-L)".into(), distance(scores.segment_accuracy)],
                vec!["completeness".into(), distance(scores.completeness)],
            ]);
        }
        text
    }
}

fn describe(counts: &WireframeCounts) -> String {
    let mut text = format!(
        "{} junctions, {} segments",
        counts.junctions, counts.segments
    );
    if let Some(length) = counts.mean_length {
        let _ = write!(text, " of mean length {length:.4}");
    }
    text
}

fn row(name: &str, scores: &[PrecisionRecall]) -> Vec<String> {
    let mut cells = vec![name.to_owned()];
    cells.extend(scores.iter().map(|s| format!("{:.3}", s.precision)));
    cells.extend(scores.iter().map(|s| format!("{:.3}", s.recall)));
    cells
}

/// A Markdown table with padded cells; the first row is the header, all rows
/// have as many cells.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<usize> = (0..columns)
        .map(|c| {
            rows.iter()
                .map(|row| row[c].chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    let rule: Vec<String> = widths.iter().map(|width| "-".repeat(*width)).collect();
    let mut text = String::new();
    for row in rows[..1].iter().chain([&rule]).chain(&rows[1..]) {
        for (cell, width) in row.iter().zip(&widths) {
            let _ = write!(text, "| {cell:<width$} ");
        }
        text += "|\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::{EvaluationConfig, Matching};
    use crate::Wireframe3d;
    use nalgebra::Vector3;

    #[test]
    fn every_number_has_its_place_and_columns_are_aligned() {
        let truth = Wireframe3d {
            junctions: vec![Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0)],
            edges: vec![[0, 1]],
        };
        let mut predicted = truth.clone();
        predicted.junctions[1].x = 2.015;
        let config = EvaluationConfig {
            matching: Matching::PerThreshold,
            ..Default::default()
        };
        let text = config
            .evaluate(&predicted, Some(&truth), Some(&truth.junctions))
            .unwrap()
            .to_markdown();
        let expected = "\
Wireframe: 2 junctions, 1 segments of mean length 2.0150.
Truth: 2 junctions, 1 segments of mean length 2.0000; the best matching per threshold.

|                               | P 0.01 | P 0.02 | P 0.05 | R 0.01 | R 0.02 | R 0.05 |
| ----------------------------- | ------ | ------ | ------ | ------ | ------ | ------ |
| junctions                     | 0.500  | 1.000  | 1.000  | 0.500  | 1.000  | 1.000  |
| segments, larger end distance | 0.000  | 1.000  | 1.000  | 0.000  | 1.000  | 1.000  |
| segments, mean end distance   | 1.000  | 1.000  | 1.000  | 1.000  | 1.000  | 1.000  |

";
        assert!(text.starts_with(expected), "{text}");
        assert!(
            text.contains("| junctions (ACC-J)       | 0.0075 |"),
            "{text}"
        );
    }

    #[test]
    fn missing_numbers_are_dashes() {
        let text = EvaluationConfig::default()
            .evaluate(&Wireframe3d::default(), None, Some(&[]))
            .unwrap()
            .to_markdown();
        assert!(
            text.starts_with("Wireframe: 0 junctions, 0 segments.\n"),
            "{text}"
        );
        assert!(
            text.contains("| completeness            | -    |"),
            "{text}"
        );
    }
}
