//! Areas found beside true ones.

use super::judged::{Judged, Summary};
use neat_core::{CircularArc, Wireframe3d};
use neat_eval::{CadFaces, FoundFace, TrueFace};
use neat_wireframe::dimensions::{DimensionError, Dimensions, Quantity};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::faces::{MeasuredGraph, find_shells};
use std::collections::BTreeMap;

/// Areas of the same face agree so well: errors are capped by the first, not by the second.
const SHARES: [f64; 2] = [0.02, 0.05];

/// All true faces by kind of scene and tolerance, off by shares of the true area: `None` where
/// none was found.
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
        let [heads, line] = Summary::HEADS;
        let mut text = format!(
            "\n| scenes | tolerance | true faces | found | {heads}\n| --- | --: | --: | --: | {line}\n"
        );
        for ((kind, share), judged) in &self.judged {
            let found = judged.iter().flatten();
            text += &format!(
                "| {kind} | {} | {} | {} | {}\n",
                SHARES[*share],
                judged.len(),
                found.clone().count(),
                Summary::of(found).cells(),
            );
        }
        text
    }
}

/// The faces of the solids that a true wireframe bounds: for truths that list none.
pub fn faces_of_solids(wireframe: &Wireframe3d, arcs: &[CircularArc]) -> Vec<TrueFace> {
    let graph = MeasuredGraph {
        arcs,
        ..MeasuredGraph::of(wireframe)
    };
    let mut shells = find_shells(&graph, &[], &[]);
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
