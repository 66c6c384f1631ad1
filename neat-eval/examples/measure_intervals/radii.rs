//! Radii found beside true ones.

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
struct Judged {
    error: f64,
    is_right: bool,
    /// Half the interval; `None` where it is not determined.
    half_width: Option<f64>,
}

/// Of the tolerance: the same curve is much nearer, its neighbour may be within.
const SHARES: [f64; 3] = [0.1, 0.5, 1.0];

/// All true arcs by kind of scene and share of the tolerance: `None` where none was found.
#[derive(Default)]
pub struct Radii {
    judged: BTreeMap<(String, usize), Vec<Option<Judged>>>,
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
                judged.push(Some(Judged {
                    error,
                    is_right: error <= RIGHT * true_arc.radius,
                    half_width: radius.interval.map(|[low, high]| 0.5 * (high - low)),
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
        let mut text = String::from(
            "\n| scenes | tolerance | true arcs | found | radius within 1 % | not determined | held | median error | median half interval |\n\
             | --- | --: | --: | --: | --: | --: | --: | --: | --: |\n",
        );
        for ((kind, share), judged) in &self.judged {
            let found: Vec<&Judged> = judged.iter().flatten().collect();
            let sure: Vec<(f64, f64)> = (found.iter())
                .filter_map(|j| Some((j.error, j.half_width?)))
                .collect();
            let held = sure.iter().filter(|(error, half)| error <= half).count();
            text += &format!(
                "| {kind} | {} | {} | {} | {} | {} | {:.3} | {:.6} | {:.6} |\n",
                SHARES[*share],
                judged.len(),
                found.len(),
                found.iter().filter(|judged| judged.is_right).count(),
                found.len() - sure.len(),
                held as f64 / sure.len() as f64,
                super::coverage::median(sure.iter().map(|(error, _)| *error)),
                super::coverage::median(sure.iter().map(|(_, half)| *half)),
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
