//! Samplers on a GPU against those on the host, with the same network and noise.

use burn::tensor::Tensor;
use neat_sdf::device_sampler::{DeviceGrid, DeviceRays};
use neat_sdf::ray_sampler::{
    Deterministic, DistanceGrid, ErrorBoundConfig, ErrorBoundTrace, GridCachedConfig, RaySampler,
    SamplingNoise, Seeded,
};
use neat_sdf::volume_rendering::rendering_weights_on_host;
use neat_sdf::{
    DeviceSamples, Distances, ImplicitNetwork, ImplicitNetworkConfig, RayBundle, RaySamples,
};
use neat_tensor::random::{Purpose, standard_normal, stream};
use neat_tests::backends::{flex, on_each_gpu_backend};
use neat_tests::comparison::assert_close;
use neat_tests::tensors::numbers;

const SCENE_RADIUS: f64 = 3.0;
/// No multiple of a group of units.
const RAYS: usize = 77;

fn network(device: &burn::tensor::Device) -> ImplicitNetwork {
    let config = ImplicitNetworkConfig {
        hidden_layers: 3,
        width: 32,
        features: 4,
        octaves: 2,
        skip_layer: 0,
        weight_norm: false,
        initial_sphere: 0.3,
        ..ImplicitNetworkConfig::default()
    };
    let mut rng = stream(5, Purpose::Weights, 0);
    let network = config.init(SCENE_RADIUS, &mut rng, &device.clone().inner());
    network.expect("a small network")
}

/// Rays from around (0, 0, −2): some hit the surface, some pass.
fn rays() -> RayBundle {
    let mut rng = stream(1, Purpose::Rays, 0);
    let mut bundle = RayBundle::default();
    for _ in 0..RAYS {
        let [a, b, c, d] = [0; 4].map(|_| standard_normal(&mut rng) as f32);
        let direction = [0.5 * c, 0.5 * d, 1.0];
        let length = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
        bundle.origins.push([0.1 * a, 0.1 * b, -2.0]);
        bundle.directions.push(direction.map(|x| x / length));
    }
    bundle
}

/// Fails unless samples agree where light is absorbed. Sums are float32 on the GPU:
/// they may decide otherwise whether a section without weight is flat, which moves
/// the samples in it. `weights` are the samples' rendering weights.
#[expect(clippy::print_stderr, reason = "measured errors belong into the log")]
fn assert_samples_agree(what: &str, found: &[f64], truth: &[f32], weights: &[f32]) {
    assert_eq!(found.len(), truth.len(), "{what}");
    let off = |(found, truth): (&f64, &f32)| (found - f64::from(*truth)).abs();
    let offs: Vec<f64> = found.iter().zip(truth).map(off).collect();
    let moved = offs.iter().filter(|off| **off > 1e-3).count();
    let shift: f64 = (weights.iter().zip(&offs))
        .map(|(weight, off)| f64::from(*weight) * off)
        .sum();
    let shift = shift / f64::from(weights.iter().sum::<f32>());
    eprintln!(
        "{what}: {moved} of {} moved, weighted mean {shift:.1e}",
        offs.len()
    );
    assert!(moved <= offs.len() / 20, "{what}: {moved} moved");
    assert!(shift <= 1e-3, "{what}: moved by {shift} on average");
}

/// Weights of `samples`, by the distances of `distances`.
fn weights(samples: &RaySamples, rays: &RayBundle, distances: &Distances, beta: f32) -> Vec<f32> {
    let points = rays.points(&samples.z, samples.per_ray);
    rendering_weights_on_host(&distances.capped(&points), samples, beta)
}

/// Fails unless intervals and points are those of the samples' distances.
fn assert_belongs_together(samples: DeviceSamples, rays: &RayBundle, last_is_infinite: bool) {
    let per_ray = samples.z.dims()[1];
    let [z, deltas] = [samples.z, samples.deltas].map(numbers);
    let z32: Vec<f32> = z.iter().map(|z| *z as f32).collect();
    let points = rays.points(&z32, per_ray);
    let points: Vec<f64> = points
        .as_flattened()
        .iter()
        .map(|x| f64::from(*x))
        .collect();
    assert_close("points", &numbers(samples.points), &points, 1e-5);
    let directions = rays.directions.iter().flat_map(|d| [*d].repeat(per_ray));
    let directions: Vec<f64> = directions.flatten().map(f64::from).collect();
    assert_close("directions", &numbers(samples.directions), &directions, 0.0);
    for (z, deltas) in z.chunks(per_ray).zip(deltas.chunks(per_ray)) {
        assert!(z.is_sorted(), "{z:?}");
        for (pair, delta) in z.windows(2).zip(deltas) {
            assert!((pair[1] - pair[0] - delta).abs() < 1e-6, "{pair:?} {delta}");
        }
        let last = deltas[per_ray - 1];
        assert!(last >= 0.0 && (last > 1e9) == last_is_infinite, "{last}");
    }
}

fn error_bound_agrees(beta: f32, noise: &(impl SamplingNoise + Clone), what: &str) {
    let config = ErrorBoundConfig::default();
    let rays = rays();
    let distances = network(&flex()).distances(&flex());
    let mut query = |points: &[[f32; 3]]| distances.capped(points);
    let mut trace = ErrorBoundTrace::default();
    let mut of_host = noise.clone();
    let host = config.sample(&rays, beta, &mut query, &mut of_host, Some(&mut trace));
    let weights = weights(&host, &rays, &distances, beta);
    let needed = trace.z.len();
    let what = format!("{what}, β {beta}, {needed} iterations");
    on_each_gpu_backend(|device| {
        let network = network(&device);
        let on_device = DeviceRays::new(&rays, &device);
        let beta = Tensor::<1>::from_data([beta], &device.clone().inner());
        for launched in 1..=config.max_iterations {
            let mut noise = noise.clone();
            let (samples, progress) =
                config.sample_on_device(&on_device, beta.clone(), &network, launched, &mut noise);
            let progress = numbers(progress);
            if launched < needed {
                assert_eq!(progress, [launched as f64, 1.0], "{what}");
                continue;
            }
            // Iterations that are not needed change nothing.
            assert_eq!(progress, [needed as f64, 0.0], "{what}");
            assert_samples_agree(&what, &numbers(samples.z.clone()), &host.z, &weights);
            assert_belongs_together(samples, &rays, true);
        }
    });
}

#[test]
fn algorithm_1_places_the_same_samples() {
    // From one iteration to more than there are.
    for beta in [1.0, 0.1, 0.02, 0.001] {
        error_bound_agrees(beta, &Deterministic, "even");
        error_bound_agrees(beta, &Seeded(stream(2, Purpose::Samples, 0)), "random");
    }
}

#[test]
fn a_cached_grid_places_the_same_samples() {
    let config = GridCachedConfig::default();
    let rays = rays();
    let distances = network(&flex()).distances(&flex());
    let mut query = |points: &[[f32; 3]]| distances.capped(points);
    let grid = || DistanceGrid::sphere(config.resolution, SCENE_RADIUS as f32, 0.9);
    for iterations in [1, 17] {
        let mut sampler = RaySampler::GridCached(config, grid());
        for iteration in 0..iterations {
            sampler.refresh(iteration, &mut query);
        }
        for beta in [0.3, 0.001] {
            let mut noise = Seeded(stream(2, Purpose::Samples, 0));
            let host = sampler.sample(&rays, beta, &mut query, &mut noise);
            let weights = weights(&host, &rays, &distances, beta);
            on_each_gpu_backend(|device| {
                let network = network(&device);
                let like = grid();
                let mut grid = DeviceGrid::new(&like, &device);
                for iteration in 0..iterations {
                    config.refresh_on_device(&like, &mut grid, iteration, &network);
                }
                let known = sampler.state().expect("a grid is state");
                let off = grid.values().into_iter().zip(known);
                let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(off < 1e-5, "the grids differ by {off}");

                let beta = Tensor::<1>::from_data([beta], &device.clone().inner());
                let mut noise = Seeded(stream(2, Purpose::Samples, 0));
                let on_device = DeviceRays::new(&rays, &device);
                let kernels = &network.mlp.kernels;
                let samples =
                    config.sample_on_device(&on_device, beta, &like, &grid, kernels, &mut noise);
                assert_samples_agree("grid", &numbers(samples.z.clone()), &host.z, &weights);
                assert_belongs_together(samples, &rays, false);
            });
        }
    }
}
