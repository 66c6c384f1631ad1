//! The authors' toy object with its real HAWP detections. The field is replaced
//! by the truth with noise, so that what is tested is the back end alone.

use crate::graph::assert_is_the_graph;
use crate::noise::{Noise, PROPOSAL_SIGMA};
use crate::prism::{Prism, with_numeric_gradient};
use crate::toy_data::toy_dir;
use nalgebra::{Vector2, Vector3};
use neat_core::ground_truth::read_wireframe;
use neat_core::{Camera, LineSegment2, LineSegment3, LoadOptions, load_scene};
use neat_wireframe::fast::{FastBackEndConfig, run};
use neat_wireframe::{SegmentProposal, SignedDistance, ViewObservation, Wireframe3d};

const HOLE_CENTER: Vector2<f64> = Vector2::new(0.1, 0.0);
const HOLE_RADIUS: f64 = 2.0 / 15.0;

/// An L-shaped prism, swept along y, with a round hole along z.
struct ToyObject(Prism);

impl ToyObject {
    fn new() -> Self {
        let third = 1.0 / 3.0;
        Self(Prism::new(
            &[
                (-third, -0.2),
                (third, -0.2),
                (third, 0.2),
                (-2.0 / 15.0, 0.2),
                (-2.0 / 15.0, 0.0),
                (-third, 0.0),
            ],
            0.5,
        ))
    }
}

impl SignedDistance for ToyObject {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points
            .iter()
            .map(|p| {
                let outside_hole = HOLE_RADIUS - (p.xy() - HOLE_CENTER).norm();
                self.0.distance(&p.xzy()).max(outside_hole)
            })
            .collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        with_numeric_gradient(self, points)
    }
}

/// What a field of medium quality would propose for every detection: the true
/// edge with 0.03 of noise where the detection shows one, anything on the right
/// rays elsewhere.
fn proposals(views: &[ViewObservation], truth: &Wireframe3d, seed: u64) -> Vec<SegmentProposal> {
    let mut noise = Noise(seed);
    let true_segments = truth.segments();
    let mut proposals = Vec::new();
    for (view, observation) in views.iter().enumerate() {
        let camera = &observation.camera;
        let project = |segment: &LineSegment3| segment.map(|end| camera.project(end).pixel);
        for (segment_in_view, detection) in observation.segments.iter().enumerate() {
            let detected = &detection.segment;
            let shown = true_segments
                .iter()
                .flat_map(|edge| [*edge, edge.reversed()])
                .find(|edge| {
                    detected
                        .end_distances(&project(edge))
                        .iter()
                        .all(|d| *d < 8.0)
                });
            let segment = match shown {
                Some(edge) => noise.jitter(&edge, PROPOSAL_SIGMA),
                None => anywhere_on_the_rays(camera, detected, &mut noise),
            };
            proposals.push(SegmentProposal {
                view,
                segment_in_view,
                segment,
                end_error_in_pixels: detected.end_distances(&project(&segment)),
                end_spread: [0.01; 2],
            });
        }
    }
    proposals
}

fn anywhere_on_the_rays(
    camera: &Camera,
    detected: &LineSegment2,
    noise: &mut Noise,
) -> LineSegment3 {
    let mut on_ray = |pixel: &Vector2<f64>| {
        let ray = camera.ray_through(pixel);
        ray.origin + ray.direction * (1.5 + noise.uniform())
    };
    LineSegment3::new(on_ray(&detected.start), on_ray(&detected.end))
}

#[test]
fn real_detections_give_the_true_graph() {
    let Some(dir) = toy_dir() else {
        return;
    };
    let scene = load_scene(&dir, &LoadOptions::default()).unwrap().scene;
    let truth = read_wireframe(&dir.join("gt_wireframe.json")).unwrap();
    let views = ViewObservation::from_scene(&scene, 0.05);
    for seed in 0..3 {
        let proposals = proposals(&views, &truth, seed);
        let config = FastBackEndConfig::default();
        let result = run(&views, &proposals, &[], &ToyObject::new(), 1.0, &config);
        assert_is_the_graph(&truth, &result, 0.003);
    }
}
