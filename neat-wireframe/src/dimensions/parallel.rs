//! Pairs of parallel edges that a drawing would dimension.

use super::{Dimension, Dimensions, Quantity, geometry};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Edges whose angle is larger are not parallel, however unsure it is, in degrees.
const MAX_ANGLE: f64 = 2.0;
/// The edges lie beside each other along this share of the shorter one.
const MIN_BESIDE: f64 = 0.5;

/// See [`Dimensions::parallels`].
pub(super) fn pairs(dimensions: &Dimensions, most: usize) -> Vec<Dimension> {
    let edges = &dimensions.document.edges;
    let ends = |edge: usize| -> [Vector3<f64>; 2] {
        edges[edge].map(|j| dimensions.document.junctions[j])
    };
    let length = |edge: usize| {
        let [a, b] = ends(edge);
        (b - a).norm()
    };
    let mut beside: Vec<[usize; 2]> = (0..edges.len())
        .into_par_iter()
        .flat_map_iter(|one| (one + 1..edges.len()).map(move |other| [one, other]))
        .filter(|pair| {
            let [one, other] = pair.map(ends);
            geometry::angle(&(one[1] - one[0]), &(other[1] - other[0])) <= MAX_ANGLE
                && are_beside(one, other)
        })
        .collect();
    let shorter = |pair: &[usize; 2]| length(pair[0]).min(length(pair[1]));
    beside.sort_by(|a, b| shorter(b).total_cmp(&shorter(a)).then(a.cmp(b)));
    let apart = |edges: [usize; 2]| {
        let angle = dimensions.measure(Quantity::Angle { edges }).ok()?;
        let gap = dimensions.measure(Quantity::Gap { edges }).ok()?;
        let is_parallel = angle.interval.is_none_or(|[low, _]| low <= 0.0);
        let is_apart = gap.interval.is_none_or(|[low, _]| low > 0.0);
        (is_parallel && is_apart).then_some(gap)
    };
    beside.into_iter().filter_map(apart).take(most).collect()
}

fn are_beside(one: [Vector3<f64>; 2], other: [Vector3<f64>; 2]) -> bool {
    let along = one[1] - one[0];
    let place = |p: Vector3<f64>| (p - one[0]).dot(&along) / along.norm_squared();
    let [a, b] = other.map(place);
    let common = a.max(b).min(1.0) - a.min(b).max(0.0);
    common >= MIN_BESIDE * (b - a).abs().min(1.0)
}
