//! The result of an evaluation: as a table, as Markdown, as JSON.

use crate::protocol::{Protocol, Scores};
use crate::table::Table;
use neat_core::{SceneError, file};
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        CadFaces, EdgeModel, EdgePoints, EditDistance, LimapLength, NeatAbc, NeatSurface,
        ScannedSurface, SceneFaces, SceneTruth, StructureScore, SurfaceAndCreases, TriangleMesh,
        TrueFace,
    };
    use nalgebra::Vector3;
    use neat_core::Wireframe3d;
    use neat_core::ground_truth::GroundTruth;
    use neat_wireframe::metrics::Matching;

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
        let scene = SceneTruth {
            edge_views: Some(vec![3]),
            surface: TriangleMesh {
                vertices: vec![Vector3::zeros(), truth.junctions[1], Vector3::y()],
                triangles: vec![[0, 1, 2]],
            },
            wireframe: truth.clone(),
            ..SceneTruth::default()
        };
        let cone = TrueFace {
            surface: None,
            area: 1.0,
            boundary: Vec::new(),
        };
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
            Scores::SurfaceAndCreases(
                SurfaceAndCreases::default()
                    .evaluate(&predicted, &scene)
                    .unwrap(),
            ),
            Scores::CadFaces(CadFaces::default().evaluate(&[], &[cone]).unwrap()),
            Scores::SceneFaces(SceneFaces::default().evaluate(&[], &scene).unwrap()),
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
