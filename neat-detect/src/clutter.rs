//! Texture: many short segments close together that meet no other.

use nalgebra::Vector2;

/// An edge between two vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FittedEdge {
    pub vertices: [usize; 2],
    /// In [0, 1].
    pub score: f64,
}

/// Segments are near if their middles are no farther apart, in reference pixels.
const RADIUS: f64 = 16.0;
/// So many others near make a segment texture
const COUNT: usize = 3;
/// if it is shorter than this, in reference pixels: what a person would draw is longer,
/// or meets something.
const LENGTH: f64 = 24.0;

/// `edges` without those that are texture; `meets_others` says of every vertex
/// whether another segment touches it. The image has `scale` pixels per reference pixel.
pub(crate) fn remove(
    edges: Vec<FittedEdge>,
    vertices: &[Vector2<f64>],
    meets_others: &[bool],
    scale: f64,
) -> Vec<FittedEdge> {
    let short_and_alone = |edge: &FittedEdge| {
        let [a, b] = edge.vertices;
        !meets_others[a] && !meets_others[b] && (vertices[a] - vertices[b]).norm() < LENGTH * scale
    };
    let middle =
        |edge: &FittedEdge| (vertices[edge.vertices[0]] + vertices[edge.vertices[1]]) / 2.0;
    let suspects: Vec<Vector2<f64>> = edges
        .iter()
        .filter(|edge| short_and_alone(edge))
        .map(middle)
        .collect();
    let is_texture = |edge: &FittedEdge| {
        let at = middle(edge);
        let near = suspects
            .iter()
            .filter(|other| (*other - at).norm() <= RADIUS * scale);
        // One of them is the segment itself.
        short_and_alone(edge) && near.count() > COUNT
    };
    edges
        .iter()
        .filter(|edge| !is_texture(edge))
        .copied()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Segments are near up to a distance of 8, and long from 12 on.
    const SCALE: f64 = 0.5;

    /// Parallel segments of length 5, `spacing` apart, none of which meet.
    fn hatching(count: usize, spacing: f64) -> (Vec<FittedEdge>, Vec<Vector2<f64>>) {
        let vertices = (0..2 * count)
            .map(|i| Vector2::new((i / 2) as f64 * spacing, (i % 2) as f64 * 5.0))
            .collect();
        let edges = (0..count)
            .map(|i| FittedEdge {
                vertices: [2 * i, 2 * i + 1],
                score: 1.0,
            })
            .collect();
        (edges, vertices)
    }

    #[test]
    fn dense_short_segments_go_and_others_stay() {
        let alone = [false; 16];
        let (edges, vertices) = hatching(8, 2.0);
        assert_eq!(remove(edges.clone(), &vertices, &alone, SCALE), []);
        let (sparse, apart) = hatching(8, 4.0);
        assert_eq!(remove(sparse, &apart, &alone, SCALE).len(), 2); // those at the rim
        let (few, near) = hatching(3, 2.0);
        assert_eq!(remove(few.clone(), &near, &alone, SCALE), few);
        let long: Vec<Vector2<f64>> = vertices
            .iter()
            .map(|v| Vector2::new(v.x, v.y * 3.0))
            .collect();
        assert_eq!(remove(edges.clone(), &long, &alone, SCALE), edges);
    }

    #[test]
    fn segments_that_meet_others_are_no_texture() {
        let (edges, vertices) = hatching(8, 2.0);
        let one_end: Vec<bool> = (0..16).map(|vertex| vertex % 2 == 0).collect();
        assert_eq!(remove(edges.clone(), &vertices, &one_end, SCALE), edges);
    }
}
