//! 2D wireframes taken from one image to another of the same view.

use super::Wireframe2d;
use nalgebra::Vector2;

impl Wireframe2d {
    /// The wireframe in an image of `size` (width, height) in which `map` says
    /// where its vertices are. Vertices that are nowhere are left out, and edges
    /// with them; others may lie outside the image.
    pub fn mapped(
        &self,
        size: (u32, u32),
        map: impl Fn(&Vector2<f64>) -> Option<Vector2<f64>>,
    ) -> Self {
        let mut mapped = Self::empty(size.0, size.1);
        // Where each vertex is among the mapped ones.
        let mut index = Vec::with_capacity(self.vertices.len());
        for (vertex, score) in self.vertices.iter().zip(&self.vertex_scores) {
            index.push(map(vertex).map(|vertex| mapped.push_vertex(vertex, *score)));
        }
        for (&[a, b], score) in self.edges.iter().zip(&self.edge_scores) {
            if let (Some(a), Some(b)) = (index[a], index[b]) {
                mapped.push_edge([a, b], *score);
            }
        }
        mapped
    }

    /// What a detector could have seen in the image alone: vertices outside it
    /// are left out, and edges end at its border, in vertices of their own with
    /// the scores of those that are left out.
    pub fn clipped_to_image(&self, pixel_center: f64) -> Self {
        let low = Vector2::repeat(pixel_center - 0.5);
        let high = low + Vector2::new(f64::from(self.width), f64::from(self.height));
        let is_inside = |vertex: &Vector2<f64>| *vertex >= low && *vertex <= high;
        let mut clipped = self.mapped((self.width, self.height), |vertex| {
            is_inside(vertex).then_some(*vertex)
        });
        clipped.edges.clear();
        clipped.edge_scores.clear();
        let inside: Vec<bool> = self.vertices.iter().map(is_inside).collect();
        // How many vertices before each are inside: its index if it is so itself.
        let index: Vec<usize> = inside
            .iter()
            .scan(0, |count, &inside| {
                Some(std::mem::replace(count, *count + usize::from(inside)))
            })
            .collect();
        for (&edge, score) in self.edges.iter().zip(&self.edge_scores) {
            let [start, end] = edge.map(|vertex| self.vertices[vertex]);
            let Some((enter, leave)) = share_inside(&start, &end, &low, &high) else {
                continue;
            };
            let ends = [(edge[0], enter), (edge[1], leave)].map(|(vertex, share)| {
                if inside[vertex] {
                    return index[vertex];
                }
                let score = self.vertex_scores[vertex];
                clipped.push_vertex(start.lerp(&end, share), score)
            });
            clipped.push_edge(ends, *score);
        }
        clipped
    }

    pub(crate) fn push_vertex(&mut self, vertex: Vector2<f64>, score: f64) -> usize {
        self.vertices.push(vertex);
        self.vertex_scores.push(score);
        self.vertices.len() - 1
    }

    pub(crate) fn push_edge(&mut self, edge: [usize; 2], score: f64) {
        self.edges.push(edge);
        self.edge_scores.push(score);
    }
}

/// Between which shares of the way from `start` to `end` a segment is within the
/// box from `low` to `high` (Liang and Barsky's clipping); `None` where that is no
/// length.
fn share_inside(
    start: &Vector2<f64>,
    end: &Vector2<f64>,
    low: &Vector2<f64>,
    high: &Vector2<f64>,
) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let step = end[axis] - start[axis];
        let (to_low, to_high) = (low[axis] - start[axis], high[axis] - start[axis]);
        if step == 0.0 {
            if to_low > 0.0 || to_high < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (to_low / step, to_high / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter < leave).then_some((enter, leave))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wireframe(vertices: &[[f64; 2]], edges: &[[usize; 2]]) -> Wireframe2d {
        Wireframe2d {
            vertices: vertices.iter().map(|&vertex| vertex.into()).collect(),
            vertex_scores: (1..)
                .map(|i| 0.125 * f64::from(i))
                .take(vertices.len())
                .collect(),
            edges: edges.to_vec(),
            edge_scores: (1..)
                .map(|i| 0.125 * f64::from(i))
                .take(edges.len())
                .collect(),
            width: 10,
            height: 8,
        }
    }

    #[test]
    fn vertices_that_are_nowhere_take_their_edges_along() {
        let before = wireframe(&[[1.0, 2.0], [5.0, 5.0], [3.0, 1.0]], &[[0, 1], [2, 0]]);
        let after = before.mapped((20, 16), |v| (v.x < 4.0).then_some(v * 2.0));
        assert_eq!(
            after.vertices,
            [Vector2::new(2.0, 4.0), Vector2::new(6.0, 2.0)]
        );
        assert_eq!(after.vertex_scores, [0.125, 0.375]);
        assert_eq!(after.edges, [[1, 0]]);
        assert_eq!(after.edge_scores, [0.25]);
        assert_eq!((after.width, after.height), (20, 16));
        after.validate().unwrap();
    }

    #[test]
    fn edges_end_at_the_border_of_the_image() {
        let before = wireframe(
            &[
                [-5.0, 4.0],
                [5.0, 4.0],
                [15.0, 4.0],
                [5.0, 20.0],
                [30.0, 0.0],
                [6.0, 6.0],
            ],
            &[[0, 1], [1, 2], [0, 2], [3, 4], [1, 5], [3, 1], [1, 1]],
        );
        for pixel_center in [0.0, 0.5] {
            let low = pixel_center - 0.5;
            let after = before.clipped_to_image(pixel_center);
            after.validate().unwrap();
            let expected = [
                // Inside: vertices 1 and 5.
                [5.0, 4.0],
                [6.0, 6.0],
                // Edge 0 from the left, 1 to the right, 2 through both, 5 from below.
                [low, 4.0],
                [low + 10.0, 4.0],
                [low, 4.0],
                [low + 10.0, 4.0],
                [5.0, low + 8.0],
            ];
            assert_eq!(after.vertices, expected.map(Vector2::from));
            assert_eq!(
                after.vertex_scores,
                [0.25, 0.75, 0.125, 0.375, 0.125, 0.375, 0.5]
            );
            let edges = [[2, 0], [0, 3], [4, 5], [0, 1], [6, 0], [0, 0]];
            assert_eq!(after.edges, edges);
            assert_eq!(after.edge_scores, [0.125, 0.25, 0.375, 0.625, 0.75, 0.875]);
        }
    }

    #[test]
    fn a_wireframe_inside_the_image_stays() {
        let before = wireframe(&[[0.0, 0.0], [10.0, 8.0], [5.0, 5.0]], &[[0, 1], [2, 1]]);
        assert_eq!(before.clipped_to_image(0.5), before);
    }
}
