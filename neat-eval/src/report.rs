//! The result of an evaluation: as a table, as Markdown, as JSON.

use crate::abc_nef::EdgePointScores;
use crate::counts::WireframeCounts;
use crate::edit_distance::EditScores;
use crate::limap_length::LengthScores;
use crate::neat_abc::{GraphScores, NeatAbcScores};
use crate::neat_dtu::SurfaceScores;
use crate::protocol::Protocol;
use crate::structure_score::StructureScores;
use crate::table::Table;
use neat_core::{SceneError, file};
use neat_wireframe::metrics::{Matching, PrecisionRecall};
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::Path;

/// What one protocol says about one result.
///
/// ```
/// use neat_eval::{EditScores, EvaluationReport, Scores};
///
/// let report = EvaluationReport::new(Scores::Wed(EditScores {
///     wed: 0.25,
///     translation: 1.0,
///     vertex_insertion: 0.0,
///     vertex_deletion: 0.0,
///     edge_insertion: 1.5,
///     edge_deletion: 0.0,
/// }));
/// assert!(report.to_markdown().contains("| WED"));
/// let json: serde_json::Value = serde_json::from_str(&report.to_json())?;
/// assert_eq!(json["protocol"], "wed");
/// assert_eq!(json["scores"]["wed"], 0.25);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluationReport {
    /// Where the protocol is published.
    pub source: String,
    /// The numbers.
    #[serde(flatten)]
    pub scores: Scores,
}

/// The numbers, by protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "protocol", content = "scores", rename_all = "kebab-case")]
pub enum Scores {
    /// NEAT on ABC.
    NeatAbc(NeatAbcScores),
    /// NEAT on DTU.
    NeatDtu(SurfaceScores),
    /// NEAT on BlendedMVS.
    NeatBlendedMvs(SurfaceScores),
    /// EMAP on ABC-NEF.
    Emap(EdgePointScores),
    /// CurveGaussian on ABC-NEF.
    CurveGaussian(EdgePointScores),
    /// EdgeGaussians on ABC-NEF.
    EdgeGaussians(EdgePointScores),
    /// NEF on ABC-NEF.
    Nef(EdgePointScores),
    /// LIMAP on Hypersim.
    LimapHypersim(LengthScores),
    /// LIMAP on Tanks and Temples.
    LimapTnt(LengthScores),
    /// Hybrid structure score.
    Hss(StructureScores),
    /// Wireframe edit distance.
    Wed(EditScores),
}

impl Scores {
    /// The protocol that they are of.
    pub fn protocol(&self) -> Protocol {
        match self {
            Self::NeatAbc(_) => Protocol::NeatAbc,
            Self::NeatDtu(_) => Protocol::NeatDtu,
            Self::NeatBlendedMvs(_) => Protocol::NeatBlendedMvs,
            Self::Emap(_) => Protocol::Emap,
            Self::CurveGaussian(_) => Protocol::CurveGaussian,
            Self::EdgeGaussians(_) => Protocol::EdgeGaussians,
            Self::Nef(_) => Protocol::Nef,
            Self::LimapHypersim(_) => Protocol::LimapHypersim,
            Self::LimapTnt(_) => Protocol::LimapTnt,
            Self::Hss(_) => Protocol::Hss,
            Self::Wed(_) => Protocol::Wed,
        }
    }

    fn tables(&self) -> Vec<Table> {
        match self {
            Self::NeatAbc(scores) => neat_abc_tables(scores),
            Self::NeatDtu(scores) | Self::NeatBlendedMvs(scores) => vec![surface_table(scores)],
            Self::Emap(scores)
            | Self::CurveGaussian(scores)
            | Self::EdgeGaussians(scores)
            | Self::Nef(scores) => edge_point_tables(scores),
            Self::LimapHypersim(scores) | Self::LimapTnt(scores) => vec![length_table(scores)],
            Self::Hss(scores) => vec![structure_table(scores)],
            Self::Wed(scores) => vec![edit_table(scores)],
        }
    }
}

impl EvaluationReport {
    /// A report of `scores`, with the source of their protocol.
    pub fn new(scores: Scores) -> Self {
        Self {
            source: scores.protocol().source().to_owned(),
            scores,
        }
    }

    /// The protocol.
    pub fn protocol(&self) -> Protocol {
        self.scores.protocol()
    }

    /// Aligned columns for a terminal.
    pub fn to_text(&self) -> String {
        self.with_tables(Table::to_text)
    }

    /// Markdown tables.
    pub fn to_markdown(&self) -> String {
        self.with_tables(Table::to_markdown)
    }

    fn with_tables(&self, print: fn(&Table) -> String) -> String {
        let protocol = self.protocol();
        let mut text = format!(
            "{protocol}: {}\n({})\n",
            protocol.explanation(),
            self.source
        );
        for table in self.scores.tables() {
            let _ = write!(text, "\n{}", print(&table));
        }
        text
    }

    /// Indented JSON with all digits.
    pub fn to_json(&self) -> String {
        // Plain structs of finite numbers and text cannot fail.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Writes [`Self::to_json`].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_json(&self, path: &Path) -> Result<(), SceneError> {
        file::write_atomically(path, (self.to_json() + "\n").as_bytes())
    }
}

fn neat_abc_tables(scores: &NeatAbcScores) -> Vec<Table> {
    let matching = match scores.matching {
        Matching::MinimumSum => "one matching with the smallest sum of distances",
        Matching::PerThreshold => "the best matching per threshold",
    };
    let truth = describe(&scores.truth);
    let table = |name: &str, graph: &GraphScores| {
        let counts = describe(&graph.counts);
        graph_table(
            format!("{name}: {counts}. Truth: {truth}; {matching}."),
            graph,
        )
    };
    let mut tables = vec![table("Wireframe", &scores.wireframe)];
    if let Some(before) = &scores.before_visibility {
        tables.push(table("Before the visibility check", before));
    }
    tables
}

fn graph_table(title: String, graph: &GraphScores) -> Table {
    let mut table = Table::new(title, &[""]);
    for letter in ["P", "R"] {
        let thresholds = graph.junctions.iter();
        table
            .header
            .extend(thresholds.map(|score| format!("{letter} {}", score.threshold)));
    }
    let row = |name: &str, scores: &[PrecisionRecall]| {
        let mut cells = vec![name.to_owned()];
        cells.extend(scores.iter().map(|s| format!("{:.3}", s.precision)));
        cells.extend(scores.iter().map(|s| format!("{:.3}", s.recall)));
        cells
    };
    table.rows = vec![
        row("junctions", &graph.junctions),
        row("segments, larger end distance", &graph.segments_max),
        row("segments, mean end distance", &graph.segments_mean),
    ];
    table
}

fn surface_table(scores: &SurfaceScores) -> Table {
    let title = format!("Wireframe: {}.", describe(&scores.counts));
    let mut table = Table::new(title, &["distance to the surface", "mean"]);
    for (name, value) in [
        ("junctions (ACC-J)", scores.junction_accuracy),
        ("segments (ACC-L)", scores.segment_accuracy),
        ("completeness", scores.completeness),
    ] {
        table.rows.push(vec![name.into(), distance(value)]);
    }
    let samples = scores.observed_samples.to_string();
    table.rows.push(vec!["samples observed".into(), samples]);
    table
}

fn edge_point_tables(scores: &EdgePointScores) -> Vec<Table> {
    let title = format!(
        "{} predicted points, {} true points",
        scores.predicted_points, scores.true_points
    );
    let mut distances = Table::new(title, &["distance", "mean"]);
    for (name, value) in [
        ("accuracy", scores.accuracy),
        ("completeness", scores.completeness),
        ("chamfer", scores.chamfer),
    ] {
        distances.rows.push(vec![name.into(), distance(value)]);
    }
    let header = ["threshold", "precision", "recall", "F-score", "IoU"];
    let mut shares = Table::new("Shares of points", &header);
    for score in &scores.thresholds {
        let mut row = vec![score.threshold.to_string()];
        let values = [score.precision, score.recall, score.f_score, score.iou];
        row.extend(values.map(|value| format!("{value:.4}")));
        shares.rows.push(row);
    }
    vec![distances, shares]
}

fn length_table(scores: &LengthScores) -> Table {
    let title = format!("{} lines, {:.3} m", scores.lines, scores.total_length);
    let mut table = Table::new(title, &["threshold", "length recall", "precision %"]);
    for score in &scores.thresholds {
        table.rows.push(vec![
            score.threshold.to_string(),
            format!("{:.3}", score.length_recall),
            format!("{:.2}", score.precision_percent),
        ]);
    }
    table
}

fn structure_table(scores: &StructureScores) -> Table {
    let mut table = Table::new("Structure, higher is better", &["score", "value"]);
    for (name, value) in [
        ("HSS", scores.hss),
        ("F1 of vertices", scores.vertex_f1),
        ("IoU of edges", scores.edge_iou),
    ] {
        table.rows.push(vec![name.into(), format!("{value:.4}")]);
    }
    table
}

fn edit_table(scores: &EditScores) -> Table {
    let mut table = Table::new("Edit distance, lower is better", &["cost", "value"]);
    for (name, value) in [
        ("WED", scores.wed),
        ("moved vertices", scores.translation),
        ("missing vertices", scores.vertex_insertion),
        ("additional vertices", scores.vertex_deletion),
        ("missing edges", scores.edge_insertion),
        ("additional edges", scores.edge_deletion),
    ] {
        table.rows.push(vec![name.into(), format!("{value:.4}")]);
    }
    table
}

fn distance(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), |value| format!("{value:.4}"))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        EdgeModel, EdgePoints, EditDistance, LimapLength, NeatAbc, NeatSurface, ScannedSurface,
        StructureScore,
    };
    use nalgebra::Vector3;
    use neat_core::Wireframe3d;
    use neat_core::ground_truth::GroundTruth;

    fn truth() -> Wireframe3d {
        Wireframe3d {
            junctions: vec![Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0)],
            edges: vec![[0, 1]],
        }
    }

    fn predicted() -> Wireframe3d {
        truth().map(|p| {
            if p.x > 0.0 {
                p.add_scalar(0.0) * 1.0075
            } else {
                *p
            }
        })
    }

    #[test]
    fn every_number_has_its_place_and_columns_are_aligned() {
        let protocol = NeatAbc {
            matching: Matching::PerThreshold,
            ..Default::default()
        };
        let scores = protocol.evaluate(&predicted(), None, &truth()).unwrap();
        let text = EvaluationReport::new(Scores::NeatAbc(scores)).to_markdown();
        let expected = "\
Wireframe: 2 junctions, 1 segments of mean length 2.0150. Truth: 2 junctions, 1 segments of mean length 2.0000; the best matching per threshold.

|                               | P 0.01 | P 0.02 | P 0.05 | R 0.01 | R 0.02 | R 0.05 |
| ----------------------------- | -----: | -----: | -----: | -----: | -----: | -----: |
| junctions                     |  0.500 |  1.000 |  1.000 |  0.500 |  1.000 |  1.000 |
| segments, larger end distance |  0.000 |  1.000 |  1.000 |  0.000 |  1.000 |  1.000 |
| segments, mean end distance   |  1.000 |  1.000 |  1.000 |  1.000 |  1.000 |  1.000 |
";
        assert!(text.ends_with(expected), "{text}");
    }

    fn one_of_each() -> Vec<Scores> {
        let (predicted, truth) = (predicted(), truth());
        let surface = ScannedSurface {
            points: truth.junctions.clone(),
            ..Default::default()
        };
        let of_surface = |protocol: NeatSurface| protocol.evaluate(&predicted, &surface).unwrap();
        let model = EdgeModel::from(predicted.clone());
        let edges = GroundTruth {
            wireframe: truth.clone(),
            curves: Vec::new(),
        };
        let of_points = |protocol: EdgePoints| protocol.evaluate(&model, &edges).unwrap();
        let of_lines = |protocol: LimapLength| {
            protocol
                .evaluate(&predicted.segments(), &truth.junctions)
                .unwrap()
        };
        vec![
            Scores::NeatAbc(
                NeatAbc::default()
                    .evaluate(&predicted, Some(&truth), &truth)
                    .unwrap(),
            ),
            Scores::NeatDtu(of_surface(NeatSurface::dtu())),
            Scores::NeatBlendedMvs(of_surface(NeatSurface::blended_mvs())),
            Scores::Emap(of_points(EdgePoints::emap())),
            Scores::CurveGaussian(of_points(EdgePoints::curve_gaussian())),
            Scores::EdgeGaussians(of_points(EdgePoints::edge_gaussians())),
            Scores::Nef(of_points(EdgePoints::nef())),
            Scores::LimapHypersim(of_lines(LimapLength::hypersim())),
            Scores::LimapTnt(of_lines(LimapLength::tanks_and_temples())),
            Scores::Hss(
                StructureScore::default()
                    .evaluate(&predicted, &truth)
                    .unwrap(),
            ),
            Scores::Wed(
                EditDistance::default()
                    .evaluate(&predicted, &truth)
                    .unwrap(),
            ),
        ]
    }

    #[test]
    fn every_protocol_prints_and_reads_back() {
        let all = one_of_each();
        let protocols: Vec<Protocol> = all.iter().map(Scores::protocol).collect();
        assert_eq!(protocols, Protocol::ALL);
        for scores in all {
            let report = EvaluationReport::new(scores);
            let name = report.protocol().name();
            let json = report.to_json();
            let back: EvaluationReport = serde_json::from_str(&json).unwrap();
            assert_eq!(back, report);
            assert!(
                json.contains(&format!("\"protocol\": \"{name}\"")),
                "{json}"
            );
            let text = report.to_text();
            assert!(text.starts_with(&format!("{name}: ")), "{text}");
            assert!(!text.contains('|') && report.to_markdown().contains('|'));
        }
    }

    #[test]
    fn missing_numbers_are_dashes() {
        let surface = ScannedSurface {
            points: truth().junctions,
            ..Default::default()
        };
        let scores = NeatSurface::default()
            .evaluate(&Wireframe3d::default(), &surface)
            .unwrap();
        let text = EvaluationReport::new(Scores::NeatDtu(scores)).to_text();
        assert!(
            text.contains("Wireframe: 0 junctions, 0 segments.\n"),
            "{text}"
        );
        assert!(text.contains("completeness                -\n"), "{text}");
    }
}
