//! How well a graph agrees with the truth.

use nalgebra::Vector3;
use neat_core::Wireframe3d;
use std::collections::BTreeSet;

/// Shares in [0, 1] and lengths in world units.
pub struct Score {
    /// Share of the found junctions that are true.
    pub junction_precision: f64,
    /// Share of the supported junctions that are found.
    pub junction_recall: f64,
    /// Share of the found edges that are true.
    pub edge_precision: f64,
    /// Share of the supported edges that are found.
    pub edge_recall: f64,
    /// Median distance of a true junction that is found from the one that finds it.
    pub median_junction_error: f64,
}

impl Score {
    /// A true junction and a found one belong together if each is the other's
    /// nearest and they are closer than `tolerance`; edges are compared by their
    /// junctions. Precision and error are against `truth`, recall is against the
    /// part of it that is `supported`.
    pub fn new(
        found: &Wireframe3d,
        truth: &Wireframe3d,
        supported: &Wireframe3d,
        tolerance: f64,
    ) -> Self {
        let all = Matching::new(found, truth, tolerance);
        let part = Matching::new(found, supported, tolerance);
        let mut errors = all.distances;
        errors.sort_by(f64::total_cmp);
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        Self {
            junction_precision: share(errors.len(), found.junctions.len()),
            junction_recall: share(part.distances.len(), supported.junctions.len()),
            edge_precision: share(all.edges, found.edges.len()),
            edge_recall: share(part.edges, supported.edges.len()),
            median_junction_error: errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN),
        }
    }
}

/// What two wireframes have in common.
struct Matching {
    /// One for each pair of junctions.
    distances: Vec<f64>,
    /// Number of common edges.
    edges: usize,
}

impl Matching {
    fn new(found: &Wireframe3d, truth: &Wireframe3d, tolerance: f64) -> Self {
        let nearest_found: Vec<_> = nearest_among(&truth.junctions, &found.junctions);
        let nearest_true: Vec<_> = nearest_among(&found.junctions, &truth.junctions);
        // For each found junction the true one and how far it is.
        let name: Vec<Option<(usize, f64)>> = nearest_true
            .iter()
            .enumerate()
            .map(|(index, nearest)| {
                let (name, distance) = (*nearest)?;
                let mutual = nearest_found[name].is_some_and(|(other, _)| other == index);
                (mutual && distance < tolerance).then_some((name, distance))
            })
            .collect();
        let sorted = |[a, b]: [usize; 2]| [a.min(b), a.max(b)];
        let true_edges: BTreeSet<_> = truth.edges.iter().map(|edge| sorted(*edge)).collect();
        let true_edges_found: BTreeSet<_> = found
            .edges
            .iter()
            .filter_map(|[a, b]| Some(sorted([name[*a]?.0, name[*b]?.0])))
            .filter(|edge| true_edges.contains(edge))
            .collect();
        Self {
            distances: name
                .iter()
                .flatten()
                .map(|(_, distance)| *distance)
                .collect(),
            edges: true_edges_found.len(),
        }
    }
}

/// For each point the index of the nearest of `others`, with its distance.
fn nearest_among(points: &[Vector3<f64>], others: &[Vector3<f64>]) -> Vec<Option<(usize, f64)>> {
    points
        .iter()
        .map(|point| {
            others
                .iter()
                .enumerate()
                .map(|(index, other)| (index, (other - point).norm()))
                .min_by(|a, b| a.1.total_cmp(&b.1))
        })
        .collect()
}
