//! What must not matter, and input that is broken.

use crate::scenario::{Detector, adjusted, scene};
use nalgebra::Vector3;
use neat_core::Wireframe3d;
use neat_core::synthetic::Solid;
use neat_wireframe::SignedDistance;
use neat_wireframe::confidence::{ConfidenceConfig, assess};

#[test]
fn the_number_of_threads_and_the_unit_of_length_do_not_matter() {
    let scene = scene(Solid::UPrism, Detector::Vertices, 0.5, 20, 1);
    let wireframe = adjusted(&scene.observations, &scene.truth, 4);
    let config = ConfidenceConfig::default();
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| {
            let surface = Some(&scene.surface as &dyn SignedDistance);
            assess(&wireframe, &scene.observations, surface, 1.0, &config).unwrap()
        })
    };
    let alone = with_threads(1);
    assert_eq!(alone, with_threads(3));

    // A power of two: the arithmetic is the same to the last bit.
    let mut observations = scene.observations.clone();
    for observation in &mut observations {
        observation.camera.center_in_world *= 4.0;
    }
    let larger = wireframe.map(|x| x * 4.0);
    let ask = |wireframe, observations: &[_], radius| {
        assess(wireframe, observations, None, radius, &config).unwrap()
    };
    let small = ask(&wireframe, &scene.observations, 1.0);
    let large = ask(&larger, &observations, 4.0);
    assert_eq!(small.edges.len(), large.edges.len());
    for (small, large) in small.junctions.iter().zip(&large.junctions) {
        let [small, large] = [small.covariance.unwrap(), large.covariance.unwrap()];
        assert!((small * 16.0 - large).amax() < 1e-6 * large.amax());
    }
    for (small, large) in small.edges.iter().zip(&large.edges) {
        assert_eq!(small.supports.len(), large.supports.len());
        assert!((small.probability - large.probability).abs() < 1e-9);
    }
}

#[test]
fn broken_and_empty_input_says_nothing_and_does_no_harm() {
    let mut scene = scene(Solid::Box, Detector::Vertices, 0.5, 20, 1);
    let config = ConfidenceConfig::default();
    let nothing = assess(&Wireframe3d::default(), &[], None, 1.0, &config).unwrap();
    assert!(nothing.junctions.is_empty() && nothing.edges.is_empty());

    let blind = assess(&scene.truth, &[], None, 1.0, &config).unwrap();
    for edge in &blind.edges {
        assert_eq!((edge.views, edge.expected_views), (0, 0));
        assert_eq!(edge.residual_in_pixels, None);
        assert!((edge.probability - config.prior).abs() < 0.05);
    }
    assert!(blind.junctions.iter().all(|j| j.covariance.is_none()));

    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let confidence = assess(&scene.truth, &scene.observations, None, radius, &config).unwrap();
        assert!(confidence.junctions.iter().all(|j| j.covariance.is_none()));
        assert!(confidence.edges.iter().all(|edge| edge.probability > 0.5));
    }

    let mut broken = scene.truth.clone();
    broken.edges.push([0, 99]);
    assess(&broken, &scene.observations, None, 1.0, &config).unwrap_err();
    broken.edges.pop();
    // No lines at all, twice the same, and one behind many cameras.
    broken.edges.extend([[1, 1], broken.edges[0]]);
    broken.junctions.push(Vector3::new(3.0, 3.0, 3.0));
    broken.edges.push([0, 8]);
    scene.observations[0].camera.intrinsics.fx = f64::NAN;
    scene.observations[1].camera.center_in_world.x = f64::INFINITY;
    scene.observations[2].segments[0].segment.end.x = f64::NAN;
    scene.observations[3].segments[0].segment.end.y = 1e300;
    scene.observations[4].segments.clear();
    let confidence = assess(&broken, &scene.observations, None, 1.0, &config).unwrap();
    for edge in &confidence.edges {
        assert!(edge.probability > 0.0 && edge.probability < 1.0);
        assert!(
            edge.supports
                .iter()
                .all(|support| ![0, 1, 4].contains(&support.view))
        );
    }
    assert!(
        confidence.junctions[..8]
            .iter()
            .all(|j| j.covariance.is_some())
    );
}

#[test]
fn configurations_without_sense_do_not_panic() {
    let scene = scene(Solid::Box, Detector::Vertices, 0.5, 8, 1);
    let changes: [fn(&mut ConfidenceConfig); 8] = [
        |c| c.tolerance_in_pixels = f64::NAN,
        |c| c.min_covered_share = -1.0,
        |c| c.usual_noise_in_pixels = 0.0,
        |c| c.max_relative_sigma = f64::INFINITY,
        |c| c.prior = f64::NAN,
        |c| c.prior = 7.0,
        |c| c.usual_detection_rate = 0.0,
        |c| c.usual_detection_rate = f64::NAN,
    ];
    for change in changes {
        let mut config = ConfidenceConfig::default();
        change(&mut config);
        let surface = Some(&scene.surface as &dyn SignedDistance);
        let asked = assess(&scene.truth, &scene.observations, surface, 1.0, &config).unwrap();
        for edge in asked.edges {
            assert!(edge.probability > 0.0 && edge.probability < 1.0);
        }
    }
}
