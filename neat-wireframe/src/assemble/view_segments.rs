//! The 2D evidence of one view, ready for geometry: back-projected rays and
//! planes, and an index of where each segment lies.

use crate::ViewObservation;
use crate::segment_grid::SegmentGrid;
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment2, LineSegment3, ScoredSegment2};

/// Names one 2D segment of the prepared views.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SegmentId {
    /// Index of the view.
    pub view: usize,
    /// Index into [`PreparedView::segments`].
    pub segment: usize,
}

/// A 2D segment with the plane that it and the camera's centre span.
#[derive(Clone, Debug)]
pub(super) struct ViewSegment {
    /// Index into the observation's segments.
    pub segment_in_view: usize,
    /// In image coordinates.
    pub segment: LineSegment2,
    /// Unit rays through both ends, in the world.
    pub rays: [Vector3<f64>; 2],
    /// Unit normal of the plane of both rays, in the world.
    pub plane_normal: Vector3<f64>,
}

/// A camera with its prepared segments.
#[derive(Clone, Debug)]
pub(super) struct PreparedView {
    /// In the world whose scene ball has radius 1.
    pub camera: Camera,
    /// Mean focal length in pixels.
    pub focal_in_pixels: f64,
    /// The usable segments, in the order of the observation.
    pub segments: Vec<ViewSegment>,
    /// Where the segments lie.
    pub index: SegmentGrid,
}

impl PreparedView {
    /// Prepares a view; lengths of the world are multiplied by `scale`. A camera
    /// that cannot be used leaves a view without segments, and segments that are
    /// not finite or shorter than `min_length_in_pixels` are left out.
    pub(super) fn new(
        observation: &ViewObservation,
        scale: f64,
        min_length_in_pixels: f64,
    ) -> Self {
        let camera = Camera {
            center_in_world: observation.camera.center_in_world * scale,
            ..observation.camera
        };
        let mut segments = Vec::new();
        if camera.validate().is_ok() {
            for (segment_in_view, detection) in observation.segments.iter().enumerate() {
                let segment = detection.segment;
                let length = segment.length();
                let long_enough = length.is_finite() && length >= min_length_in_pixels;
                if !long_enough || !detection.score.is_finite() {
                    continue;
                }
                let rays = segment.ends().map(|end| camera.ray_through(&end).direction);
                let Some(plane_normal) = rays[0].cross(&rays[1]).try_normalize(1e-12) else {
                    continue;
                };
                segments.push(ViewSegment {
                    segment_in_view,
                    segment,
                    rays,
                    plane_normal,
                });
            }
        }
        let shapes: Vec<LineSegment2> = segments.iter().map(|s| s.segment).collect();
        Self {
            focal_in_pixels: 0.5 * (camera.intrinsics.fx + camera.intrinsics.fy),
            index: SegmentGrid::new(&shapes, camera.width, camera.height),
            camera,
            segments,
        }
    }

    /// The same camera with other segments, of any length.
    pub(super) fn with_segments(&self, segments: &[LineSegment2]) -> Self {
        let scored = |(edge, segment): (usize, &LineSegment2)| ScoredSegment2 {
            segment: *segment,
            score: 1.0,
            edge,
        };
        let observation = ViewObservation {
            camera: self.camera,
            segments: segments.iter().enumerate().map(scored).collect(),
            junctions: Vec::new(),
        };
        Self::new(&observation, 1.0, 0.0)
    }

    /// The same segments, seen by another camera of the same image.
    pub(super) fn moved_to(&self, camera: Camera) -> Self {
        let mut moved = Self {
            camera,
            ..self.clone()
        };
        for segment in &mut moved.segments {
            let rays = segment
                .segment
                .ends()
                .map(|end| camera.ray_through(&end).direction);
            segment.rays = rays;
            segment.plane_normal = rays[0].cross(&rays[1]).normalize();
        }
        moved
    }

    /// The 3D segment whose ends lie at these distances on the rays of a 2D
    /// segment's ends.
    pub(super) fn back_project(&self, segment: usize, depths: [f64; 2]) -> LineSegment3 {
        let rays = self.segments[segment].rays;
        let at = |side: usize| self.camera.center_in_world + depths[side] * rays[side];
        LineSegment3::new(at(0), at(1))
    }

    /// Length in the world of one pixel at a point.
    pub(super) fn pixel_size_at(&self, point_in_world: &Vector3<f64>) -> f64 {
        (point_in_world - self.camera.center_in_world).norm() / self.focal_in_pixels
    }
}

/// The 2D segment that an id names.
pub(super) fn segment_of(views: &[PreparedView], id: SegmentId) -> &ViewSegment {
    &views[id.view].segments[id.segment]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{cameras_on_sphere, cube, views_of_edges};

    #[test]
    fn planes_hold_the_edges() {
        let (junctions, edges) = cube();
        let observations = views_of_edges(&cameras_on_sphere(3), &junctions, &edges);
        for observation in &observations {
            let view = PreparedView::new(observation, 1.0, 1.0);
            for (segment, [a, b]) in view.segments.iter().zip(&edges) {
                for junction in [junctions[*a], junctions[*b]] {
                    let offset = junction - view.camera.center_in_world;
                    assert!(offset.dot(&segment.plane_normal).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_used_is_left_out() {
        let (junctions, edges) = cube();
        let mut observations = views_of_edges(&cameras_on_sphere(2), &junctions, &edges);
        observations[0].segments[3].segment.start.x = f64::NAN;
        observations[0].segments[4].segment.end = observations[0].segments[4].segment.start;
        let view = PreparedView::new(&observations[0], 1.0, 1.0);
        assert_eq!(view.segments.len(), edges.len() - 2);
        assert_eq!(view.segments[3].segment_in_view, 5);
        observations[1].camera.center_in_world.x = f64::NAN;
        assert!(
            PreparedView::new(&observations[1], 1.0, 1.0)
                .segments
                .is_empty()
        );
    }
}
