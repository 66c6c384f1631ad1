//! The numbers of the protocol, and their tables.

use super::recall_bins::RecallBin;
use crate::table::Table;
use serde::{Deserialize, Serialize};

/// How near a result is to the surfaces and creases of a rendered scene. Lengths and
/// distances are in the unit of the truth; shares are from 0 to 1, and `None` where there is
/// nothing to take a share of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CreaseScores {
    /// What thresholds and spacing were multiplied by.
    pub scale: f64,
    /// Size of the result.
    pub predicted: CreaseCounts,
    /// Size of the truth: its corners and straight edges.
    pub truth: CreaseCounts,
    /// ACC-J: distances of the junctions from the surface.
    pub junction_accuracy: Option<MeanAndMedian>,
    /// ACC-L: distances of 32 points on every edge from the surface.
    pub segment_accuracy: Option<MeanAndMedian>,
    /// One entry per threshold.
    pub thresholds: Vec<CreaseShares>,
    /// Recall by the length of the true edges.
    pub by_length: Vec<RecallBin>,
    /// Recall by the number of views that see a true edge; `None` where nobody knows.
    pub by_views: Option<Vec<RecallBin>>,
}

/// The size of a result or a truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CreaseCounts {
    /// Junctions with an edge; of the truth, its corners.
    pub junctions: usize,
    /// Straight edges.
    pub edges: usize,
    /// Their length.
    pub length: f64,
}

/// Of some distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeanAndMedian {
    /// Mean.
    pub mean: f64,
    /// Median: half of them are shorter.
    pub median: f64,
}

/// Shares at one threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CreaseShares {
    /// Distances count that are as long or shorter.
    pub threshold: f64,
    /// Of the junctions, those on the surface.
    pub junctions_on_surface: Option<f64>,
    /// Of 32 points per edge, those on the surface.
    pub points_on_surface: Option<f64>,
    /// Completeness: of the length of the straight true edges, what the result follows.
    pub completeness: Option<f64>,
    /// The same of edges of more than half a metre (times the scale).
    pub completeness_of_long: Option<f64>,
    /// Of the length of the curved true edges, what the result follows, with twice the angle.
    pub completeness_of_curved: Option<f64>,
    /// Of the true corners, those with a junction.
    pub junction_recall: Option<f64>,
    /// Of the junctions, those at a true one, corner or not.
    pub junction_precision: Option<f64>,
    /// Of the length of the result, what is on the surface.
    pub length_on_surface: Option<f64>,
    /// Of the length of the result, what follows a straight true edge.
    pub length_on_straight_crease: Option<f64>,
    /// Of the length of the result, what follows a true edge, straight or curved: precision.
    pub length_on_crease: Option<f64>,
    /// Of the length of the result, what follows a true edge or a painted line.
    pub length_on_crease_or_texture: Option<f64>,
    /// F1 of precision and completeness; 0 without one of them.
    pub f1: f64,
}

/// The rows of the main table.
type Row = (&'static str, fn(&CreaseShares) -> Option<f64>);
const ROWS: [Row; 12] = [
    ("junctions on the surface", |s| s.junctions_on_surface),
    ("points on the surface, 32 per edge", |s| {
        s.points_on_surface
    }),
    ("completeness", |s| s.completeness),
    ("completeness, long edges", |s| s.completeness_of_long),
    ("completeness, curved", |s| s.completeness_of_curved),
    ("junction recall", |s| s.junction_recall),
    ("junction precision", |s| s.junction_precision),
    ("length on the surface", |s| s.length_on_surface),
    ("length on a straight crease", |s| {
        s.length_on_straight_crease
    }),
    ("length on any crease", |s| s.length_on_crease),
    ("length on a crease or texture line", |s| {
        s.length_on_crease_or_texture
    }),
    ("F1 of creases", |s| Some(s.f1)),
];

impl CreaseScores {
    pub(crate) fn tables(&self) -> Vec<Table> {
        let mut tables = vec![self.accuracy_table(), self.share_table()];
        let of_length = |bin: &RecallBin| match bin.to {
            Some(to) => format!("{} to {}", number(bin.from), number(to)),
            None => format!("above {}", number(bin.from)),
        };
        tables.push(self.recall_table(
            "Completeness by length of the edge.",
            &self.by_length,
            of_length,
        ));
        let of_views = |bin: &RecallBin| match bin.to {
            Some(to) => format!("{} to {to} views", bin.from),
            None => format!("{} views and more", bin.from),
        };
        if let Some(bins) = &self.by_views {
            let title = "Completeness by number of views that see more than half of the edge.";
            tables.push(self.recall_table(title, bins, of_views));
        }
        tables
    }

    fn accuracy_table(&self) -> Table {
        let size = |counts: &CreaseCounts, junctions: &str| {
            format!(
                "{} {junctions}, {} edges of {:.2} in all",
                counts.junctions, counts.edges, counts.length
            )
        };
        let title = format!(
            "Wireframe: {}. Truth: {}.",
            size(&self.predicted, "junctions"),
            size(&self.truth, "corners")
        );
        let mut table = Table::new(title, &["distance to the surface", "mean", "median"]);
        for (name, accuracy) in [
            ("junctions (ACC-J)", self.junction_accuracy),
            ("edges (ACC-L)", self.segment_accuracy),
        ] {
            // Four digits of a house are too few for a desk.
            let cell = |value: fn(&MeanAndMedian) -> f64| {
                accuracy.map_or_else(|| "-".into(), |of| format!("{:.5}", value(&of)))
            };
            let row = vec![name.into(), cell(|of| of.mean), cell(|of| of.median)];
            table.rows.push(row);
        }
        table
    }

    fn share_table(&self) -> Table {
        let mut table = Table::new("Shares in percent.", &["within"]);
        table
            .header
            .extend(self.thresholds.iter().map(|s| number(s.threshold)));
        for (name, share) in ROWS {
            let shares = self.thresholds.iter().map(|shares| percent(share(shares)));
            table
                .rows
                .push(std::iter::once(name.into()).chain(shares).collect());
        }
        table
    }

    fn recall_table(
        &self,
        title: &str,
        bins: &[RecallBin],
        name: impl Fn(&RecallBin) -> String,
    ) -> Table {
        let mut table = Table::new(title, &["edges", "length"]);
        table
            .header
            .extend(self.thresholds.iter().map(|s| number(s.threshold)));
        for bin in bins {
            let mut row = vec![name(bin), format!("{:.2}", bin.length)];
            let share = |index: usize| bin.recall.as_ref().map(|recall| recall[index]);
            row.extend((0..self.thresholds.len()).map(|index| percent(share(index))));
            table.rows.push(row);
        }
        table
    }
}

/// A length without the noise of its last digits: 0.0025, where 0.05 · 0.05 is a little more.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".into(), |share| format!("{:.1}", 100.0 * share))
}
