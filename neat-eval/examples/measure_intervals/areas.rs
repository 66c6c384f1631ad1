//! Areas found beside true ones.

use super::coverage::median;
use neat_core::{CircularArc, Wireframe3d};
use neat_eval::{CadFaces, FoundFace, TrueFace};
use neat_wireframe::dimensions::{DimensionError, Dimensions, Quantity};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{MeasuredGraph, find_shells};
use std::collections::BTreeMap;

/// Areas of the same face agree so well: errors are capped by the first, not by the second.
const SHARES: [f64; 2] = [0.02, 0.05];

/// An area with its true one.
struct Judged {
    /// By the true area, as half the interval.
    error: f64,
    half_width: Option<f64>,
}

/// All true faces by kind of scene and tolerance: `None` where none was found.
#[derive(Default)]
pub struct Areas {
    judged: BTreeMap<(String, usize), Vec<Option<Judged>>>,
}

impl Areas {
    /// Adds the true faces, each with the face of the document that is found for it.
    pub fn add(
        &mut self,
        kind: &str,
        document: &WireframeDocument,
        truth: &[TrueFace],
    ) -> Result<(), DimensionError> {
        let dimensions = Dimensions::new(document, None)?;
        let found = FoundFace::of_document(document);
        for (index, share) in SHARES.into_iter().enumerate() {
            let same = CadFaces {
                max_area_error: share,
                ..CadFaces::default()
            };
            let judged = self.judged.entry((kind.to_owned(), index)).or_default();
            for (true_face, face) in truth.iter().zip(same.partners(&found, truth)) {
                let Some(face) = face else {
                    judged.push(None);
                    continue;
                };
                let area = dimensions.measure(Quantity::Area { face })?;
                let half = |[low, high]: [f64; 2]| 0.5 * (high - low) / true_face.area;
                judged.push(Some(Judged {
                    error: (area.value / true_face.area - 1.0).abs(),
                    half_width: area.interval.map(half),
                }));
            }
        }
        Ok(())
    }

    /// As Markdown; empty where no scene has true faces.
    pub fn table(&self) -> String {
        if self.judged.is_empty() {
            return String::new();
        }
        let mut text = String::from(
            "\n| scenes | tolerance | true faces | found | not determined | held | median error | median half interval |\n\
             | --- | --: | --: | --: | --: | --: | --: | --: |\n",
        );
        for ((kind, share), judged) in &self.judged {
            let found: Vec<&Judged> = judged.iter().flatten().collect();
            let sure: Vec<(f64, f64)> = (found.iter())
                .filter_map(|j| Some((j.error, j.half_width?)))
                .collect();
            let held = sure.iter().filter(|(error, half)| error <= half).count();
            text += &format!(
                "| {kind} | {} | {} | {} | {} | {:.3} | {:.6} | {:.6} |\n",
                SHARES[*share],
                judged.len(),
                found.len(),
                found.len() - sure.len(),
                held as f64 / sure.len() as f64,
                median(sure.iter().map(|(error, _)| *error)),
                median(sure.iter().map(|(_, half)| *half)),
            );
        }
        text
    }
}

/// The faces of the solids that a true wireframe bounds: for truths that list none.
pub fn faces_of_solids(wireframe: &Wireframe3d, arcs: &[CircularArc]) -> Vec<TrueFace> {
    let graph = MeasuredGraph {
        wireframe,
        arcs,
        covariances: &[],
    };
    let mut shells = find_shells(&graph, &[]);
    shells.retain(|shell| shell.closed);
    let document = WireframeDocument {
        arcs: arcs.to_vec(),
        shells,
        ..WireframeDocument::from(wireframe)
    };
    let face = |face: FoundFace| TrueFace {
        surface: Some(face.surface),
        area: face.area,
        boundary: face.triangles.concat(),
    };
    let found = FoundFace::of_document(&document);
    found.into_iter().map(face).collect()
}
