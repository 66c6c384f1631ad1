//! WED, the wireframe edit distance of building wireframes.
//!
//! Source: S23DR challenge 2024; Liu et al., *PC2WF* (ICLR 2021), with the costs
//! of `hoho/wed.py` of s23dr/hoho2025. Lower is better.
//!
//! Vertices are paired one to one with the smallest sum of distances. Moving a
//! vertex costs its distance, an additional one a quarter and a missing one half
//! of the truth's diameter; an additional or a missing edge costs its length,
//! where edges between vertices without partner cost nothing of their own. The sum
//! is divided by the length of all true edges. Beforehand the prediction is moved
//! and scaled to the mean and the spread of the true vertices, as published; turn
//! that off where position and scale matter.
//!
//! One thing differs: the published code compares edges as Python sets turned into
//! tuples, whose order is not always the same for equal sets. Here edges are equal
//! when they join the same vertices.

use crate::EvalError;
use crate::table::Table;
use crate::total::total;
use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_wireframe::metrics::{MetricsError, junction_distances};
use neat_wireframe::validity::check_wireframe;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The costs.
#[derive(Clone, Debug, PartialEq)]
pub struct EditDistance {
    /// Cost of a missing vertex, by the truth's diameter.
    pub insertion: f64,
    /// Cost of an additional vertex, by the truth's diameter.
    pub deletion: f64,
    /// Cost of an additional or a missing edge, by its length.
    pub edge: f64,
    /// Whether the prediction is first moved and scaled onto the truth.
    pub register: bool,
}

impl Default for EditDistance {
    fn default() -> Self {
        Self {
            insertion: 0.5,
            deletion: 0.25,
            edge: 1.0,
            register: true,
        }
    }
}

/// WED and what it is made of; the parts in the unit of the wireframes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EditScores {
    /// Sum of all costs by the length of all true edges.
    pub wed: f64,
    /// Moving vertices.
    pub translation: f64,
    /// Missing vertices.
    pub vertex_insertion: f64,
    /// Additional vertices.
    pub vertex_deletion: f64,
    /// Missing edges.
    pub edge_insertion: f64,
    /// Additional edges.
    pub edge_deletion: f64,
}

impl EditScores {
    pub(crate) fn table(&self) -> Table {
        let values = [
            ("WED", self.wed),
            ("moved vertices", self.translation),
            ("missing vertices", self.vertex_insertion),
            ("additional vertices", self.vertex_deletion),
            ("missing edges", self.edge_insertion),
            ("additional edges", self.edge_deletion),
        ];
        let values = values.map(|(name, value)| (name, format!("{value:.4}")));
        Table::of_values("Edit distance, lower is better", ["cost", "value"], values)
    }
}

impl EditDistance {
    /// Measures `predicted` against `truth`.
    ///
    /// # Errors
    /// If a wireframe is not valid, or the true edges have no length.
    pub fn evaluate(
        &self,
        predicted: &Wireframe3d,
        truth: &Wireframe3d,
    ) -> Result<EditScores, EvalError> {
        check_wireframe(&predicted.junctions, &predicted.edges).map_err(MetricsError::Predicted)?;
        check_wireframe(&truth.junctions, &truth.edges).map_err(MetricsError::Truth)?;
        let true_length: f64 = truth.segments().iter().map(|s| s.length()).sum();
        if true_length <= 0.0 {
            return Err(EvalError::EmptyTruth {
                protocol: "s23dr-wed",
                missing: "edge with a length",
            });
        }
        let vertices = if self.register {
            registered(&predicted.junctions, &truth.junctions)
        } else {
            predicted.junctions.clone()
        };
        let pairs = junction_distances(&vertices, &truth.junctions)?
            .assign()
            .map_err(MetricsError::from)?;
        let true_of: BTreeMap<usize, usize> = pairs.iter().map(|p| (p.row, p.column)).collect();
        let predicted_of: BTreeMap<usize, usize> =
            pairs.iter().map(|p| (p.column, p.row)).collect();

        let edge = |a: usize, b: usize| (a != b).then(|| (a.min(b), a.max(b)));
        let true_edges: BTreeSet<_> = truth
            .edges
            .iter()
            .filter_map(|&[a, b]| edge(a, b))
            .collect();
        let predicted_edges: BTreeSet<_> = predicted
            .edges
            .iter()
            .filter_map(|[a, b]| edge(*true_of.get(a)?, *true_of.get(b)?))
            .collect();
        // Named by true vertices, but as long as they were predicted.
        let predicted_length = |&(a, b): &(usize, usize)| {
            let ends = (predicted_of.get(&a), predicted_of.get(&b));
            match ends {
                (Some(&a), Some(&b)) => (vertices[a] - vertices[b]).norm(),
                _ => 0.0,
            }
        };
        let true_edge_length =
            |&(a, b): &(usize, usize)| (truth.junctions[a] - truth.junctions[b]).norm();

        let diameter = diameter(&truth.junctions);
        let missing = truth.junctions.len() - pairs.len();
        let additional = vertices.len() - pairs.len();
        let scores = EditScores {
            wed: 0.0,
            translation: total(pairs.iter().map(|pair| pair.distance)),
            vertex_insertion: self.insertion * diameter * missing as f64,
            vertex_deletion: self.deletion * diameter * additional as f64,
            edge_insertion: self.edge
                * total(
                    true_edges
                        .difference(&predicted_edges)
                        .map(true_edge_length),
                ),
            edge_deletion: self.edge
                * total(
                    predicted_edges
                        .difference(&true_edges)
                        .map(predicted_length),
                ),
        };
        let sum = scores.translation
            + scores.vertex_insertion
            + scores.vertex_deletion
            + scores.edge_insertion
            + scores.edge_deletion;
        Ok(EditScores {
            wed: sum / true_length,
            ..scores
        })
    }
}

/// `points` with the mean and the spread of `target`.
fn registered(points: &[Vector3<f64>], target: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let (mean, spread) = mean_and_spread(points);
    let (target_mean, target_spread) = mean_and_spread(target);
    points
        .iter()
        .map(|point| (point - mean) / spread * target_spread + target_mean)
        .collect()
}

/// The mean, and the norm of the standard deviations along the axes. A deviation
/// of 0 counts as 1, as published.
fn mean_and_spread(points: &[Vector3<f64>]) -> (Vector3<f64>, f64) {
    let count = points.len().max(1) as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / count;
    let variance = points
        .iter()
        .map(|point| (point - mean).map(|x| x * x))
        .sum::<Vector3<f64>>()
        / count;
    let deviation = variance.map(|x| if x == 0.0 { 1.0 } else { x.sqrt() });
    (mean, deviation.norm())
}

/// The largest distance of two points.
fn diameter(points: &[Vector3<f64>]) -> f64 {
    let pairs = points
        .iter()
        .enumerate()
        .flat_map(|(i, a)| points[..i].iter().map(move |b| (a - b).norm()));
    pairs.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of side 2 with its four edges; the diameter is √8.
    fn square() -> Wireframe3d {
        Wireframe3d {
            junctions: [
                [0.0, 0.0, 0.0],
                [2.0, 0.0, 0.0],
                [2.0, 2.0, 0.0],
                [0.0, 2.0, 0.0],
            ]
            .map(Vector3::from)
            .to_vec(),
            edges: vec![[0, 1], [1, 2], [2, 3], [3, 0]],
        }
    }

    fn plain() -> EditDistance {
        EditDistance {
            register: false,
            ..EditDistance::default()
        }
    }

    #[test]
    fn equal_wireframes_have_no_distance_and_registration_forgives_a_similarity() {
        let moved = square().map(|p| p * 3.0 + Vector3::new(5.0, -1.0, 0.0));
        let found = EditDistance::default().evaluate(&moved, &square()).unwrap();
        // The spread is √(1 + 1 + 1²) = √3 for the truth, where z has none and
        // counts 1, and √(9 + 9 + 1) for the prediction: not quite a similarity.
        let scale = 3.0 * 3.0_f64.sqrt() / 19.0_f64.sqrt();
        let shift = (scale - 1.0) * 2.0_f64.sqrt();
        assert!((found.wed - 4.0 * shift / 8.0).abs() < 1e-12, "{found:?}");
        let found = plain().evaluate(&square(), &square()).unwrap();
        assert_eq!(found.wed, 0.0);
    }

    #[test]
    fn every_cost_by_hand() {
        let mut predicted = square();
        predicted.junctions[0].z = 0.5; // moved
        predicted.edges[3] = [1, 3]; // one edge is missing, a diagonal is too many
        predicted.junctions.push(Vector3::new(9.0, 9.0, 9.0));
        predicted.edges.push([2, 4]); // its end has no partner: no cost
        predicted.edges.push([2, 1]); // the same as [1, 2]
        let found = plain().evaluate(&predicted, &square()).unwrap();
        assert_eq!(found.translation, 0.5);
        assert_eq!(found.vertex_insertion, 0.0);
        assert!((found.vertex_deletion - 0.25 * 8.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(found.edge_insertion, 2.0);
        assert!((found.edge_deletion - 8.0_f64.sqrt()).abs() < 1e-15);
        let expected = (2.5 + 1.25 * 8.0_f64.sqrt()) / 8.0;
        assert!((found.wed - expected).abs() < 1e-15);
    }

    #[test]
    fn nothing_predicted_costs_the_whole_truth() {
        let found = EditDistance::default()
            .evaluate(&Wireframe3d::default(), &square())
            .unwrap();
        let expected = (4.0 * 0.5 * 8.0_f64.sqrt() + 8.0) / 8.0;
        assert!((found.wed - expected).abs() < 1e-15);
        assert!(
            EditDistance::default()
                .evaluate(&square(), &Wireframe3d::default())
                .is_err()
        );
    }
}
