//! Short edges between junctions that no segment was found for.

use crate::line_fitting::{FittedSegment, LineFitter};
use nalgebra::Vector2;
use neat_core::LineSegment2;

/// Edges are round at corners: so much at each end, in pixels, is not looked at.
const CORNER: f64 = 1.5;
/// Shorter edges cannot be told from a corner, in pixels.
const MIN_LENGTH: f64 = 4.0;
/// An edge must be there along this share of the rest.
const MIN_SUPPORT: f64 = 0.9;
/// Nearer than this to another segment, in pixels, the edge is that one's.
const OTHERS_EDGE: f64 = 1.0;
/// Cosine of the smallest angle to another edge of the same junction.
const MAX_COS_ANGLE: f64 = 0.97;

/// Junctions no farther apart, in reference pixels, are joined by an edge where the image
/// shows one between them: longer ones the search finds itself.
const MAX_LENGTH: f64 = 25.0;

/// A new edge, and the image edge that it stands for.
pub(crate) struct CompletedEdge {
    pub vertices: [usize; 2],
    pub fitted: FittedSegment,
}

/// Edges between vertices at most [`MAX_LENGTH`] apart that are not joined by `edges`,
/// where the image shows a straight edge; the shortest first. The image has `scale`
/// pixels per reference pixel.
pub(crate) fn complete(
    vertices: &[Vector2<f64>],
    edges: &[[usize; 2]],
    scale: f64,
    fitter: &LineFitter,
) -> Vec<CompletedEdge> {
    let max_length = MAX_LENGTH * scale;
    let mut candidates = Vec::new();
    // Sorted by x, so that only near vertices are compared.
    let mut order: Vec<usize> = (0..vertices.len()).collect();
    order.sort_by(|&a, &b| vertices[a].x.total_cmp(&vertices[b].x).then(a.cmp(&b)));
    for (i, &a) in order.iter().enumerate() {
        for &b in order[i + 1..]
            .iter()
            .take_while(|&&b| vertices[b].x - vertices[a].x <= max_length)
        {
            let length = (vertices[b] - vertices[a]).norm();
            if (MIN_LENGTH..=max_length).contains(&length) {
                candidates.push((length, [a.min(b), a.max(b)]));
            }
        }
    }
    candidates.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));

    let mut all: Vec<[usize; 2]> = edges.to_vec();
    let mut completed = Vec::new();
    for (_, [a, b]) in candidates {
        let segment = LineSegment2::new(vertices[a], vertices[b]);
        if !fitter.supports(&segment, CORNER, MIN_SUPPORT)
            || belongs_to_another(&segment, [a, b], vertices, &all)
        {
            continue;
        }
        if let Some(fitted) = fitter.describe(&segment, 0.0) {
            all.push([a, b]);
            completed.push(CompletedEdge {
                vertices: [a, b],
                fitted,
            });
        }
    }
    completed
}

/// Whether the edge between two vertices is, or is part of, one of `edges`.
fn belongs_to_another(
    segment: &LineSegment2,
    ends: [usize; 2],
    vertices: &[Vector2<f64>],
    edges: &[[usize; 2]],
) -> bool {
    let direction = (segment.end - segment.start).normalize();
    let middle = segment.point_at(0.5);
    edges.iter().any(|&[c, d]| {
        let other = LineSegment2::new(vertices[c], vertices[d]);
        let shared = [c, d].into_iter().find(|vertex| ends.contains(vertex));
        let turned = shared.is_some_and(|shared| {
            let other_end = if shared == c { d } else { c };
            let own_end = if shared == ends[0] { ends[1] } else { ends[0] };
            let own = (vertices[own_end] - vertices[shared]).normalize();
            let others = (vertices[other_end] - vertices[shared]).normalize();
            own.dot(&others) > MAX_COS_ANGLE
        });
        let along = direction.dot(&(other.end - other.start).normalize()).abs() > MAX_COS_ANGLE;
        turned || (along && other.distance_to_point(&middle) <= OTHERS_EDGE)
    })
}
