//! Triangles of patches: the Delaunay triangulation of their places, with those of a grid among them.

use super::face::{Face, Step};
use super::patch::{PatchFace, place_on_side, with_points};
use super::round_triangulation::{Corner, Ring, between};
use nalgebra::{Vector2, Vector3};
use neat_core::LineSegment2;

/// Cells along each side of the grid: as many as halves of the pieces of curves that turn by half a
/// turn.
const GRID: usize = 16;
/// Places of the grid nearer to a hole than this share of a cell make slivers.
const BESIDE: f64 = 0.3;

/// The places of the grid within a patch, with the points there.
pub(super) fn inner_places(face: &PatchFace) -> Vec<(Vector2<f64>, Vector3<f64>)> {
    let places = (1..GRID).flat_map(|i| (1..GRID).map(move |j| [i, j]));
    let places = places.map(|place| Vector2::from(place.map(|k| k as f64 / GRID as f64)));
    let near = BESIDE / GRID as f64;
    let is_free = |place: &Vector2<f64>| {
        let mut sides = face.holes.iter().flat_map(|hole| hole.windows(2));
        face.contains(place)
            && sides.all(|ends| LineSegment2::new(ends[0], ends[1]).distance_to_point(place) > near)
    };
    let free = places.filter(is_free);
    free.map(|place| (place, face.patch.point(&place)))
        .collect()
}

/// Appends the triangles of a patch; returns how many places it has within.
///
/// - `along`: the indices of the points along a step, both ends among them.
/// - `first`: the index of the first of [`inner_places`].
pub(super) fn cut_patch(
    face: &Face,
    along: impl Fn(&Step) -> Vec<usize>,
    points: &[Vector3<f64>],
    first: usize,
    triangles: &mut Vec<[usize; 3]>,
) -> usize {
    let positions = |step: &Step| along(step).iter().map(|index| points[*index]).collect();
    let (Some(patch), Some(sides)) = (PatchFace::new(face, positions), face.sides()) else {
        return 0;
    };
    let chain = |steps: &[Step]| {
        let mut indices: Vec<usize> = steps.iter().flat_map(&along).collect();
        indices.dedup();
        indices
    };
    let Some(sides) = with_points(sides.map(chain)) else {
        return 0;
    };
    let mut outer: Ring = Vec::new();
    for (side, indices) in sides.iter().enumerate() {
        let mut lengths = vec![0.0];
        for pair in indices.windows(2) {
            let length = (points[pair[1]] - points[pair[0]]).norm();
            lengths.push(lengths[lengths.len() - 1] + length);
        }
        let whole = lengths[lengths.len() - 1];
        // The last one is the first of the next side, unless it is the only one.
        let count = (indices.len() - 1).max(1);
        let corners = indices[..count].iter().zip(&lengths);
        outer.extend(corners.map(|(index, length)| {
            let share = if whole > 0.0 { length / whole } else { 0.0 };
            Corner {
                index: *index,
                place: place_on_side(side, share),
            }
        }));
    }
    let mut rings = vec![outer];
    for steps in &face.loops[1..] {
        let corner = |index: usize| Corner {
            index,
            place: patch.patch.place(&points[index]),
        };
        let mut ring: Ring = chain(steps).into_iter().map(corner).collect();
        if ring.len() > 1 && ring[0].index == ring[ring.len() - 1].index {
            ring.pop();
        }
        rings.push(ring);
    }
    let inner = inner_places(&patch).into_iter().enumerate();
    let inner: Vec<Corner> = inner
        .map(|(k, (place, _))| Corner {
            index: first + k,
            place,
        })
        .collect();
    let cut = between(&rings, &inner).unwrap_or_default().into_iter();
    // At a side that is a point.
    let is_flat = |[a, b, c]: &[usize; 3]| a == b || b == c || a == c;
    triangles.extend(cut.filter(|corners| !is_flat(corners)));
    inner.len()
}
