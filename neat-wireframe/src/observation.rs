//! What the images say: the 2D segments and junctions seen by each camera.

use nalgebra::Vector2;
use neat_core::{Camera, Scene, ScoredSegment2};

/// One view's camera and the 2D evidence in it.
#[derive(Clone, Debug)]
pub struct ViewObservation {
    /// Intrinsics and pose.
    pub camera: Camera,
    /// Detected segments with scores, in image coordinates.
    pub segments: Vec<ScoredSegment2>,
    /// All detected junctions, in image coordinates.
    pub junctions: Vec<Vector2<f64>>,
}

impl ViewObservation {
    /// The evidence of every view of a scene: segments with a score above
    /// `min_score`, and all junctions.
    pub fn from_scene(scene: &Scene, min_score: f64) -> Vec<Self> {
        scene
            .views
            .iter()
            .map(|view| Self {
                camera: view.camera,
                segments: view.wireframe.segments(min_score),
                junctions: view.wireframe.vertices.clone(),
            })
            .collect()
    }
}

/// What tells the detected ends of all views apart. Ends of one vertex have the same
/// coordinates: that is how 2D wireframes reach this crate.
pub(crate) fn end_key(view: usize, end: &Vector2<f64>) -> (usize, [u64; 2]) {
    (view, [end.x, end.y].map(f64::to_bits))
}
