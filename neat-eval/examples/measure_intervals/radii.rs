//! Radii found beside true ones.

use super::judged::{Judged, Summary};
use neat_core::CircularArc;
use neat_wireframe::dimensions::{DimensionError, Dimensions, Quantity};
use neat_wireframe::export::WireframeDocument;
use std::collections::BTreeMap;

/// An arc is a true one if it runs along so many places of it …
const MIN_PLACES: usize = 3;
/// … of these, as shares of its length.
const PLACES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// A radius is right that is off by no more than this share of it.
const RIGHT: f64 = 0.01;

/// A radius with its true one.
struct JudgedRadius {
    judged: Judged,
    is_right: bool,
}

/// Of the tolerance: the same curve is much nearer, its neighbour may be within.
const SHARES: [f64; 3] = [0.1, 0.5, 1.0];

/// All true arcs by kind of scene and share of the tolerance: `None` where none was found.
#[derive(Default)]
pub struct Radii {
    judged: BTreeMap<(String, usize), Vec<Option<JudgedRadius>>>,
}

impl Radii {
    /// Adds the true arcs, each with the arc of the document that is paired with it.
    pub fn add(
        &mut self,
        kind: &str,
        document: &WireframeDocument,
        truth: &[CircularArc],
        tolerance: f64,
    ) -> Result<(), DimensionError> {
        let dimensions = Dimensions::new(document, None)?;
        for (index, share) in SHARES.iter().enumerate() {
            let judged = self.judged.entry((kind.to_owned(), index)).or_default();
            let paired = paired(&document.arcs, truth, share * tolerance);
            for (true_arc, arc) in truth.iter().zip(paired) {
                let Some(arc) = arc else {
                    judged.push(None);
                    continue;
                };
                let radius = dimensions.measure(Quantity::Radius { arc })?;
                let error = (radius.value - true_arc.radius).abs();
                judged.push(Some(JudgedRadius {
                    judged: Judged {
                        error,
                        half_width: radius.interval.map(|[low, high]| 0.5 * (high - low)),
                    },
                    is_right: error <= RIGHT * true_arc.radius,
                }));
            }
        }
        Ok(())
    }

    /// As Markdown; empty where no scene has true arcs.
    pub fn table(&self) -> String {
        if self.judged.is_empty() {
            return String::new();
        }
        let [heads, line] = Summary::HEADS;
        let mut text = format!(
            "\n| scenes | tolerance | true arcs | found | radius within 1 % | {heads}\n\
             | --- | --: | --: | --: | --: | {line}\n"
        );
        for ((kind, share), judged) in &self.judged {
            let found = judged.iter().flatten();
            text += &format!(
                "| {kind} | {} | {} | {} | {} | {}\n",
                SHARES[*share],
                judged.len(),
                found.clone().count(),
                found.clone().filter(|radius| radius.is_right).count(),
                Summary::of(found.map(|radius| &radius.judged)).cells(),
            );
        }
        text
    }
}

/// For each true arc the one that is found for it: one to one, the nearest first.
fn paired(found: &[CircularArc], truth: &[CircularArc], tolerance: f64) -> Vec<Option<usize>> {
    let mut near = Vec::new();
    for (arc, found) in found.iter().enumerate() {
        near.extend((truth.iter().enumerate()).filter_map(|(true_arc, truth)| {
            Some((distance(found, truth, tolerance)?, true_arc, arc))
        }));
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pairs = vec![None; truth.len()];
    for (_, true_arc, arc) in near {
        if pairs[true_arc].is_none() && !pairs.contains(&Some(arc)) {
            pairs[true_arc] = Some(arc);
        }
    }
    pairs
}

/// The mean distance of places of a true arc from an arc that runs along most of them.
fn distance(found: &CircularArc, truth: &CircularArc, tolerance: f64) -> Option<f64> {
    let near: Vec<f64> = (PLACES.iter())
        .map(|place| truth.point_at(truth.angles[0] + place * truth.sweep()))
        .filter(|point| found.contains(found.angle_of(point), tolerance / found.radius))
        .map(|point| found.distance_to_circle(&point))
        .filter(|distance| *distance <= tolerance)
        .collect();
    (near.len() >= MIN_PLACES).then(|| near.iter().sum::<f64>() / near.len() as f64)
}
