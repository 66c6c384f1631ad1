//! Lengths found beside true ones.

use super::judged::{Judged, Summary};
use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_wireframe::dimensions::{DimensionError, Dimensions, Quantity};
use neat_wireframe::export::WireframeDocument;
use std::collections::BTreeMap;

/// Of the tolerance.
const SHARES: [f64; 3] = [0.5, 1.0, 2.0];

/// All lengths by kind of scene, whether an end is free, and share of the tolerance.
#[derive(Default)]
pub struct Coverage {
    judged: BTreeMap<(String, bool, usize), Vec<Judged>>,
}

impl Coverage {
    /// Adds the edges of a document that are edges of the truth, both in one frame.
    pub fn add(
        &mut self,
        kind: &str,
        document: &WireframeDocument,
        truth: &Wireframe3d,
        tolerance: f64,
    ) -> Result<(), DimensionError> {
        let dimensions = Dimensions::new(document, None)?;
        for (index, share) in SHARES.iter().enumerate() {
            for [edge, true_edge] in pairs(document, truth, share * tolerance) {
                let length = dimensions.measure(Quantity::Length { edge })?;
                let [a, b] = truth.edges[true_edge].map(|j| truth.junctions[j]);
                let key = (kind.to_owned(), length.free_end, index);
                self.judged.entry(key).or_default().push(Judged {
                    error: (length.value - (b - a).norm()).abs(),
                    half_width: length.interval.map(|[low, high]| 0.5 * (high - low)),
                });
            }
        }
        Ok(())
    }

    /// As Markdown.
    pub fn table(&self) -> String {
        let [heads, line] = Summary::HEADS;
        let mut text = format!(
            "| scenes | free end | tolerance | lengths | {heads}\n| --- | --- | --: | --: | {line}\n"
        );
        for ((kind, free, share), judged) in &self.judged {
            let summary = Summary::of(judged.iter());
            text += &format!(
                "| {kind} | {} | {} | {} | {}\n",
                if *free { "yes" } else { "no" },
                SHARES[*share],
                summary.determined,
                summary.cells(),
            );
        }
        text
    }
}

/// Edges with true ones, one to one, the nearest first, no end farther off than `tolerance`.
fn pairs(document: &WireframeDocument, truth: &Wireframe3d, tolerance: f64) -> Vec<[usize; 2]> {
    let mut near = Vec::new();
    for (edge, ends) in document.edges.iter().enumerate() {
        let ends = ends.map(|j| document.junctions[j]);
        for (true_edge, true_ends) in truth.edges.iter().enumerate() {
            let [a, b] = true_ends.map(|j| truth.junctions[j]);
            let off = |true_ends: [Vector3<f64>; 2]| {
                (ends[0] - true_ends[0])
                    .norm()
                    .max((ends[1] - true_ends[1]).norm())
            };
            let distance = off([a, b]).min(off([b, a]));
            if distance <= tolerance {
                near.push((distance, [edge, true_edge]));
            }
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut taken = [
        vec![false; document.edges.len()],
        vec![false; truth.edges.len()],
    ];
    near.retain(|(_, [edge, true_edge])| {
        let free = !taken[0][*edge] && !taken[1][*true_edge];
        if free {
            (taken[0][*edge], taken[1][*true_edge]) = (true, true);
        }
        free
    });
    near.into_iter().map(|(_, pair)| pair).collect()
}
