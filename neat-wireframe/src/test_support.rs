//! Small cameras and views for the unit tests of the paper's back end.

use crate::ViewObservation;
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment2, ScoredSegment2};

/// A 100×100 camera at the origin that looks along +z: focal length 100,
/// principal point (50, 50).
pub fn camera_at_origin() -> Camera {
    Camera {
        intrinsics: Intrinsics {
            fx: 100.0,
            fy: 100.0,
            cx: 50.0,
            cy: 50.0,
            skew: 0.0,
        },
        world_from_camera: Matrix3::identity(),
        center_in_world: Vector3::zeros(),
        width: 100,
        height: 100,
    }
}

/// What that camera sees: segments as (start, end, score).
pub fn observation(segments: &[([f64; 2], [f64; 2], f64)]) -> ViewObservation {
    ViewObservation {
        camera: camera_at_origin(),
        segments: segments
            .iter()
            .enumerate()
            .map(|(edge, (start, end, score))| ScoredSegment2 {
                segment: LineSegment2::new(Vector2::from(*start), Vector2::from(*end)),
                score: *score,
                edge,
            })
            .collect(),
        junctions: Vec::new(),
    }
}
