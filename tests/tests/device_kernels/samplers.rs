//! Samplers on a GPU against those on the host, with the same network and noise.

use burn::tensor::Tensor;
use neat_sdf::device_sampler::{DeviceGrid, DeviceRays};
use neat_sdf::ray_sampler::{
    Deterministic, DistanceGrid, ErrorBoundConfig, ErrorBoundTrace, GridCachedConfig, RaySampler,
    SamplingNoise, Seeded,
};
use neat_sdf::{ImplicitNetwork, ImplicitNetworkConfig, RayBundle, RaySamples};
use neat_tensor::random::{Purpose, standard_normal, stream};
use neat_tests::backends::{flex, on_each_gpu_backend};
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
    config.init(SCENE_RADIUS, &mut rng, &device.clone().inner())
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

/// Longest section that a ray begins with: two cells of 127.
const SECTION: f64 = 2.0 * 6.0 / 127.0;

/// Fails unless all but a few samples agree. Sums are float32 on the GPU. Where one
/// says whether a section without weight is flat, samples in it move.
fn assert_samples_agree(what: &str, found: (&[f64], &[f64]), host: &RaySamples) {
    for (part, found, truth) in [("z", found.0, &host.z), ("deltas", found.1, &host.deltas)] {
        assert_eq!(found.len(), truth.len(), "{what}, {part}");
        let off = |(found, truth): (&f64, &f32)| (found - f64::from(*truth)).abs();
        let offs: Vec<f64> = found.iter().zip(truth).map(off).collect();
        let moved = offs.iter().filter(|off| **off > 1e-3).count();
        let farthest = offs.iter().fold(0.0, |far, off| f64::max(far, *off));
        eprintln!("{what}, {part}: {moved} of {} moved, at most {farthest:.1e}", offs.len());
        assert!(offs.iter().all(|off| *off <= SECTION), "{what}, {part}: {farthest}");
        assert!(moved <= offs.len() / 100, "{what}, {part}: {moved} moved");
    }
}

fn error_bound_agrees(beta: f32, noise: &(impl SamplingNoise + Clone), what: &str) {
    let config = ErrorBoundConfig::default();
    let rays = rays();
    let mut distances = network(&flex()).distances(&flex());
    let mut trace = ErrorBoundTrace::default();
    let mut of_host = noise.clone();
    let host = config.sample(&rays, beta, &mut distances, &mut of_host, Some(&mut trace));
    let needed = trace.z.len();
    let what = format!("{what}, β {beta}, {needed} iterations");
    on_each_gpu_backend(|device| {
        let network = network(&device);
        let rays = DeviceRays::new(&rays, &device);
        let beta = Tensor::<1>::from_data([beta], &device.clone().inner());
        for launched in 1..=config.max_iterations {
            let mut noise = noise.clone();
            let (samples, progress) =
                config.sample_on_device(&rays, beta.clone(), &network, launched, &mut noise);
            let progress = numbers(progress);
            if launched < needed {
                assert_eq!(progress, [launched as f64, 1.0], "{what}");
                continue;
            }
            // Iterations that are not needed change nothing.
            assert_eq!(progress, [needed as f64, 0.0], "{what}");
            let (z, deltas) = (numbers(samples.z), numbers(samples.deltas));
            assert_samples_agree(&what, (&z, &deltas), &host);
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
    let mut distances = network(&flex()).distances(&flex());
    let grid = || DistanceGrid::sphere(config.resolution, SCENE_RADIUS as f32, 0.9);
    for iterations in [1, 17] {
        let mut sampler = RaySampler::GridCached(config, grid());
        for iteration in 0..iterations {
            sampler.refresh(iteration, &mut distances);
        }
        for beta in [0.3, 0.001] {
            let mut noise = Seeded(stream(2, Purpose::Samples, 0));
            let host = sampler.sample(&rays, beta, &mut distances, &mut noise);
            on_each_gpu_backend(|device| {
                let network = network(&device);
                let like = grid();
                let mut grid = DeviceGrid::new(&like, &device);
                for iteration in 0..iterations {
                    config.refresh_on_device(&like, &mut grid, iteration, &network);
                }
                let known = sampler.state().expect("a grid is state");
                let off = grid.values().into_iter().zip(known).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f32::max) < 1e-5, "the grids agree");

                let beta = Tensor::<1>::from_data([beta], &device.clone().inner());
                let mut noise = Seeded(stream(2, Purpose::Samples, 0));
                let rays = DeviceRays::new(&rays, &device);
                let samples = config.sample_on_device(&rays, beta, &like, &grid, &mut noise);
                let (z, deltas) = (numbers(samples.z), numbers(samples.deltas));
                assert_samples_agree("grid", (&z, &deltas), &host);
            });
        }
    }
}
