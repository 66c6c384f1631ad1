//! How many views see each true edge: a view does if more than half of the edge is in its
//! image with no surface before it.

use super::scene_truth::SceneTruth;
use crate::triangle_mesh::Surface;
use neat_core::{Camera, LineSegment3};
use rayon::prelude::*;

/// Points of an edge that are looked for in every view.
const POINTS: usize = 16;

/// The number of views that see each edge: what the truth says, else what its cameras and
/// surface show; `None` where there are no cameras either.
///
/// Surfaces that are less than `margin` before an edge do not hide it: its own two do not.
pub(super) fn edge_views(truth: &SceneTruth, surface: &Surface, margin: f64) -> Option<Vec<usize>> {
    if truth.edge_views.is_some() || truth.cameras.is_empty() {
        return truth.edge_views.clone();
    }
    let seen_by = |segment: &LineSegment3| {
        let cameras = truth.cameras.iter();
        let sees = |camera: &&Camera| {
            let points = (0..POINTS).map(|i| segment.point_at((i as f64 + 0.5) / POINTS as f64));
            let seen = points.filter(|point| surface.shows(camera, point, margin));
            2 * seen.count() > POINTS
        };
        cameras.filter(sees).count()
    };
    Some(truth.wireframe.segments().par_iter().map(seen_by).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle_mesh::tests::cube;
    use nalgebra::{Matrix3, Vector3};
    use neat_core::{Intrinsics, Wireframe3d};

    /// Looks from (0.5, 0.5, 5) down on the cube.
    fn from_above(focal_length: f64) -> Camera {
        Camera {
            intrinsics: Intrinsics::centered(focal_length, (100, 100)),
            world_from_camera: Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
            center_in_world: Vector3::new(0.5, 0.5, 5.0),
            width: 100,
            height: 100,
        }
    }

    #[test]
    fn the_upper_edges_of_a_cube_are_seen_from_above() {
        let surface = Surface::new(&cube());
        let edges = vec![[4, 5], [0, 1], [0, 4]];
        let junctions = cube().vertices;
        let mut truth = SceneTruth {
            wireframe: Wireframe3d { junctions, edges },
            surface: cube(),
            ..SceneTruth::default()
        };
        assert_eq!(edge_views(&truth, &surface, 0.01), None);
        // Of the second camera the image ends before the edges.
        truth.cameras = vec![from_above(100.0), from_above(1000.0), from_above(100.0)];
        // The upper edge, the lower one, and one between them that the top hides.
        assert_eq!(edge_views(&truth, &surface, 0.01), Some(vec![2, 0, 0]));
        truth.edge_views = Some(vec![7, 8, 9]);
        assert_eq!(edge_views(&truth, &surface, 0.01), Some(vec![7, 8, 9]));
    }
}
