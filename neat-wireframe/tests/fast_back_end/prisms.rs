//! Prisms: exact geometry, noisy detections, proposals that are off by several
//! times what the result may be.

use crate::graph::assert_is_the_graph;
use crate::noise::{Noise, PROPOSAL_SIGMA};
use crate::prism::{Prism, Scaled};
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment2, LineSegment3, ScoredSegment2};
use neat_wireframe::fast::{FastBackEndConfig, FastBackEndResult, run};
use neat_wireframe::{SegmentProposal, SignedDistance, ViewObservation, Wireframe3d};

/// A camera at distance 2.5 that looks at the origin; `i` of `count` on a
/// Fibonacci lattice.
fn camera(i: usize, count: usize) -> Camera {
    let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
    let (sin, cos) = (i as f64 * 2.399_963).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    let outward = Vector3::new(radius * cos, radius * sin, z);
    let right = outward.cross(&Vector3::new(0.1, 0.2, 1.0)).normalize();
    Camera {
        intrinsics: Intrinsics {
            fx: 700.0,
            fy: 690.0,
            cx: 256.0,
            cy: 250.0,
            skew: 0.0,
        },
        world_from_camera: Matrix3::from_columns(&[right, right.cross(&outward), -outward]),
        center_in_world: 2.5 * outward,
        width: 512,
        height: 512,
    }
}

/// Detections and proposals of a prism.
struct Input {
    observations: Vec<ViewObservation>,
    proposals: Vec<SegmentProposal>,
}

const FALSE_DETECTIONS_PER_VIEW: usize = 2;

impl Input {
    /// Visible edges are detected in 85 % of the views with 0.7 pixels of noise,
    /// in any order of ends; their proposals are the true segments with 0.03 of
    /// noise. False detections have false proposals.
    fn new(prism: &Prism, views: usize, seed: u64) -> Self {
        let mut noise = Noise(seed);
        let truth = prism.wireframe().segments();
        let mut input = Self {
            observations: Vec::new(),
            proposals: Vec::new(),
        };
        for view in 0..views {
            let camera = camera(view, views);
            let mut segments = Vec::new();
            for edge in &truth {
                if !prism.sees(&camera, edge) || noise.uniform() > 0.85 {
                    continue;
                }
                let edge = if noise.uniform() < 0.5 {
                    *edge
                } else {
                    edge.reversed()
                };
                let projected = edge.map(|end| camera.project(end).pixel);
                let segment = noise.jitter(&projected, 0.7);
                let proposed = noise.jitter(&edge, PROPOSAL_SIGMA);
                input.propose(view, segments.len(), &camera, &segment, proposed);
                segments.push((segment, 0.5 + 0.5 * noise.uniform()));
            }
            for _ in 0..FALSE_DETECTIONS_PER_VIEW {
                let anywhere =
                    |noise: &mut Noise| 512.0 * Vector2::new(noise.uniform(), noise.uniform());
                let segment = LineSegment2::new(anywhere(&mut noise), anywhere(&mut noise));
                let proposed =
                    LineSegment3::new(noise.normal_vector(0.4), noise.normal_vector(0.4));
                input.propose(view, segments.len(), &camera, &segment, proposed);
                segments.push((segment, 0.3));
            }
            input.observations.push(ViewObservation {
                camera,
                segments: segments
                    .into_iter()
                    .enumerate()
                    .map(|(edge, (segment, score))| ScoredSegment2 {
                        segment,
                        score,
                        edge,
                    })
                    .collect(),
                junctions: Vec::new(),
            });
        }
        input
    }

    fn propose(
        &mut self,
        view: usize,
        segment_in_view: usize,
        camera: &Camera,
        detected: &LineSegment2,
        segment: LineSegment3,
    ) {
        let projected = segment.map(|end| camera.project(end).pixel);
        self.proposals.push(SegmentProposal {
            view,
            segment_in_view,
            segment,
            end_error_in_pixels: detected.end_distances(&projected),
            end_spread: [0.01; 2],
        });
    }

    fn run(&self, prism: &Prism, config: &FastBackEndConfig) -> FastBackEndResult {
        let surface = Scaled(prism, 1.0);
        run(
            &self.observations,
            &self.proposals,
            &[],
            &surface,
            1.0,
            config,
        )
    }
}

#[test]
fn prisms_come_back_exactly() {
    for prism in [Prism::cube(), Prism::l_shape()] {
        for seed in 0..3 {
            let input = Input::new(&prism, 40, seed);
            let result = input.run(&prism, &FastBackEndConfig::default());
            assert_is_the_graph(&prism.wireframe(), &result, 0.003);
            for edge in &result.edges {
                assert!(edge.support >= 5);
                assert!(edge.support_ratio.is_some_and(|ratio| ratio >= 0.3));
            }
        }
    }
}

#[test]
fn every_step_can_be_left_out() {
    let prism = Prism::l_shape();
    let input = Input::new(&prism, 40, 1);
    let perceived: Vec<_> = prism.wireframe().junctions;
    let surface = Scaled(&prism, 1.0);
    let run_without = |leave_out: fn(&mut FastBackEndConfig)| {
        let mut config = FastBackEndConfig::default();
        leave_out(&mut config);
        run(
            &input.observations,
            &input.proposals,
            &perceived,
            &surface,
            1.0,
            &config,
        )
    };

    let without_perceived = run_without(|c| c.use_perceived_junctions = false);
    assert_eq!(without_perceived.report.added_perceived_junctions, 0);
    assert_is_the_graph(&prism.wireframe(), &without_perceived, 0.003);

    let without_modes = run_without(|c| c.use_junction_modes = false);
    assert_eq!(without_modes.report.junction_modes, 0);
    assert_is_the_graph(&prism.wireframe(), &without_modes, 0.003);

    // Modes lie within 0.015 or so: the bundle adjustment alone repairs much.
    let without_retriangulation = run_without(|c| c.retriangulation = false);
    assert!(without_retriangulation.wireframe.edges.len() >= 9);

    let without_completion = run_without(|c| c.edge_completion = false);
    assert_is_the_graph(&prism.wireframe(), &without_completion, 0.003);

    let without_adjustment = run_without(|c| c.bundle_adjustment = false);
    assert_is_the_graph(&prism.wireframe(), &without_adjustment, 0.006);

    let without_occlusion = run_without(|c| c.occlusion_test = false);
    assert!(without_occlusion.wireframe.edges.len() >= 18);
    for edge in &without_occlusion.edges {
        assert_eq!((edge.visible_views, edge.support_ratio), (None, None));
    }

    let without_cleanup = run_without(|c| c.cleanup = false);
    assert!(without_cleanup.wireframe.edges.len() >= 18);

    let without_junctions = run_without(|c| {
        c.use_junction_modes = false;
        c.use_perceived_junctions = false;
    });
    assert_eq!(without_junctions.wireframe, Wireframe3d::default());
    assert!(without_junctions.report.segment_ends > 0);
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let prism = Prism::cube();
    let input = Input::new(&prism, 30, 5);
    let config = FastBackEndConfig::default();
    let result = input.run(&prism, &config);
    // A power of two: the arithmetic is the same to the last bit.
    let scale = 4.0;
    let mut observations = input.observations.clone();
    for view in &mut observations {
        view.camera.center_in_world *= scale;
    }
    let mut proposals = input.proposals.clone();
    for proposal in &mut proposals {
        proposal.segment = proposal.segment.map(|end| end * scale);
        proposal.end_spread = proposal.end_spread.map(|spread| spread * scale);
    }
    let surface = Scaled(&prism, scale);
    let scaled = run(&observations, &proposals, &[], &surface, scale, &config);
    assert_eq!(scaled.wireframe.map(|x| x / scale), result.wireframe);
    assert_eq!(scaled.edges, result.edges);
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let prism = Prism::l_shape();
    let input = Input::new(&prism, 30, 2);
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| input.run(&prism, &FastBackEndConfig::default()))
    };
    let alone = with_threads(1);
    assert_eq!(alone, with_threads(2));
    assert_eq!(alone, with_threads(5));
}

#[test]
fn empty_and_broken_input_gives_an_empty_result() {
    let prism = Prism::cube();
    let config = FastBackEndConfig::default();
    let surface = Scaled(&prism, 1.0);
    let input = Input::new(&prism, 20, 3);
    let empty = Wireframe3d::default();

    let nothing = run(&[], &[], &[], &surface, 1.0, &config);
    assert_eq!(nothing.wireframe, empty);
    assert_eq!(nothing.report.usable_views, 0);
    let no_proposals = run(
        &input.observations,
        &[],
        &[Vector3::zeros()],
        &surface,
        1.0,
        &config,
    );
    assert_eq!(no_proposals.wireframe, empty);
    assert_eq!(no_proposals.report.usable_views, 20);
    let no_views = run(&[], &input.proposals, &[], &surface, 1.0, &config);
    assert_eq!(no_views.report.usable_proposals, 0);
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let result = run(
            &input.observations,
            &input.proposals,
            &[],
            &surface,
            radius,
            &config,
        );
        assert_eq!(result, FastBackEndResult::default());
    }

    let one_view = run(
        &input.observations[..1],
        &input.proposals,
        &[],
        &surface,
        1.0,
        &config,
    );
    assert_eq!(one_view.report.usable_views, 1);
    assert_eq!(one_view.wireframe, empty);

    let mut broken = input.observations.clone();
    for view in &mut broken {
        view.camera.world_from_camera[(1, 1)] = f64::NAN;
    }
    let nan_cameras = run(&broken, &input.proposals, &[], &surface, 1.0, &config);
    assert_eq!(nan_cameras.wireframe, empty);
    assert_eq!(nan_cameras.report.usable_views, 0);

    struct NanSurface;
    impl SignedDistance for NanSurface {
        fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
            vec![f64::NAN; points.len()]
        }
        fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            vec![(f64::NAN, Vector3::repeat(f64::NAN)); points.len()]
        }
    }
    let hidden = run(
        &input.observations,
        &input.proposals,
        &[],
        &NanSurface,
        1.0,
        &config,
    );
    assert!(
        hidden
            .edges
            .iter()
            .all(|edge| edge.visible_views == Some(0))
    );
}

#[test]
fn one_broken_view_costs_only_itself() {
    let prism = Prism::cube();
    let mut input = Input::new(&prism, 40, 4);
    input.observations[7].camera.center_in_world.x = f64::NAN;
    input.observations[9].segments[0].segment.end.x = f64::INFINITY;
    input.proposals[0].segment.start.z = f64::NAN;
    let result = input.run(&prism, &FastBackEndConfig::default());
    assert_eq!(result.report.usable_views, 39);
    assert_is_the_graph(&prism.wireframe(), &result, 0.003);
}
