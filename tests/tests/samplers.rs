//! Properties that all ray samplers share, whatever the scene.

use neat_sdf::ray_sampler::{
    Deterministic, DistanceGrid, ErrorBoundConfig, GridCachedConfig, RaySampler, RaySamplerConfig,
    Seeded, UniformConfig,
};
use neat_sdf::{RayBundle, RaySamples};
use neat_tensor::random::{Purpose, standard_normal, stream};
use rayon::ThreadPoolBuilder;

const SCENE_RADIUS: f64 = 3.0;
const SURFACE_RADIUS: f32 = 0.8;
const BETA: f32 = 0.02;

fn norm(p: &[f32; 3]) -> f32 {
    p.iter().map(|x| x * x).sum::<f32>().sqrt()
}

/// A sphere around the origin.
fn sphere(points: &[[f32; 3]]) -> Vec<f32> {
    assert!(!points.is_empty(), "a query about nothing");
    points.iter().map(|p| norm(p) - SURFACE_RADIUS).collect()
}

/// Rays from around (0, 0, −2) in all directions: some hit the sphere, some pass.
fn rays(count: usize) -> RayBundle {
    let mut rng = stream(1, Purpose::Rays, 0);
    let mut bundle = RayBundle::default();
    for _ in 0..count {
        let [a, b, c, d, e] = [0; 5].map(|_| standard_normal(&mut rng) as f32);
        bundle.origins.push([0.1 * a, 0.1 * b, -2.0]);
        let direction = [0.5 * c, 0.5 * d, 1.0 + 0.1 * e];
        let length = norm(&direction);
        bundle.directions.push(direction.map(|x| x / length));
    }
    bundle
}

/// All samplers by name, with caches that know the sphere.
fn samplers() -> Vec<(&'static str, RaySampler)> {
    let configs = [
        (
            "error bound",
            RaySamplerConfig::ErrorBound(ErrorBoundConfig::default()),
        ),
        (
            "grid",
            RaySamplerConfig::GridCached(GridCachedConfig::default()),
        ),
        (
            "redrawn",
            RaySamplerConfig::GridCached(GridCachedConfig {
                redraw: true,
                ..GridCachedConfig::default()
            }),
        ),
        (
            "uniform",
            RaySamplerConfig::Uniform(UniformConfig::default()),
        ),
    ];
    configs
        .map(|(name, config)| {
            let mut sampler = config.init(SCENE_RADIUS, 0.6);
            sampler.refresh_all(&mut sphere);
            (name, sampler)
        })
        .into()
}

fn random(sampler: &RaySampler, rays: &RayBundle) -> RaySamples {
    let mut noise = Seeded(stream(2, Purpose::Samples, 0));
    sampler.sample(rays, BETA, &mut sphere, &mut noise)
}

fn assert_sorted_and_finite(what: &str, rays: &RayBundle, samples: &RaySamples) {
    assert_eq!(samples.z.len(), rays.len() * samples.per_ray, "{what}");
    assert_eq!(samples.deltas.len(), samples.z.len(), "{what}");
    for (z, deltas) in samples
        .z
        .chunks(samples.per_ray)
        .zip(samples.deltas.chunks(samples.per_ray))
    {
        assert!(z.iter().all(|z| z.is_finite()), "{what}: {z:?}");
        assert!(z.is_sorted(), "{what}: {z:?}");
        assert!(z[0] >= 0.0 && z[z.len() - 1] <= 6.0, "{what}: {z:?}");
        for (i, delta) in deltas.iter().enumerate().take(z.len() - 1) {
            assert_eq!(*delta, z[i + 1] - z[i], "{what}");
        }
        assert!(deltas[z.len() - 1] >= 0.0, "{what}");
    }
}

#[test]
fn samples_are_sorted_and_between_near_and_far() {
    let rays = rays(100);
    for (name, sampler) in samplers() {
        let even = sampler.sample(&rays, BETA, &mut sphere, &mut Deterministic);
        assert_sorted_and_finite(name, &rays, &even);
        let random = random(&sampler, &rays);
        assert_sorted_and_finite(name, &rays, &random);
        assert_ne!(even.z, random.z, "{name}: noise moves samples");
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let rays = rays(57);
    for (name, sampler) in samplers() {
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| {
                let even = sampler.sample(&rays, BETA, &mut sphere, &mut Deterministic);
                [even, random(&sampler, &rays)].map(|samples| (samples.z, samples.deltas))
            })
        };
        assert_eq!(on(1), on(4), "{name}");
    }
}

#[test]
fn rays_that_miss_everything_have_samples_too() {
    // Past the ball, away from it, and along its axis from far outside.
    let rays = RayBundle {
        origins: vec![[0.0, 5.0, -4.0], [0.0, 0.0, 4.0], [0.0, 0.0, -2.0]],
        directions: vec![[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]],
    };
    // Convergence is decided for the batch: the sharp density keeps the sampler
    // asking while nothing is near the first rays at all.
    for beta in [BETA, 1e-4] {
        for (name, sampler) in samplers() {
            let samples = sampler.sample(&rays, beta, &mut sphere, &mut Deterministic);
            assert!(
                samples.z.iter().all(|z| z.is_finite()),
                "{name}: {:?}",
                samples.z
            );
            assert!(samples.deltas.iter().all(|delta| *delta >= 0.0), "{name}");
        }
    }
}

#[test]
fn no_rays_no_samples_no_questions() {
    for (name, sampler) in samplers() {
        let mut query = |_: &[[f32; 3]]| -> Vec<f32> { panic!("{name}: a query about nothing") };
        let samples = sampler.sample(&RayBundle::default(), BETA, &mut query, &mut Deterministic);
        assert!(samples.z.is_empty() && samples.deltas.is_empty(), "{name}");
    }
}

#[test]
fn informed_samplers_gather_at_the_surface() {
    let rays = RayBundle {
        origins: vec![[0.0, 0.0, -2.0]],
        directions: vec![[0.0, 0.0, 1.0]],
    };
    let surface = 2.0 - SURFACE_RADIUS;
    for (name, sampler) in samplers() {
        let samples = random(&sampler, &rays);
        let near = samples
            .z
            .iter()
            .filter(|z| (**z - surface).abs() < 0.3)
            .count();
        let share = near as f64 / samples.per_ray as f64;
        // Evenly spread, a tenth would lie there.
        assert!(name == "uniform" || share > 0.4, "{name}: {share}");
    }
}

#[test]
fn a_refreshed_grid_knows_planes_exactly() {
    let plane = |p: &[f32; 3]| 0.3 * p[0] - 0.5 * p[1] + 0.8 * p[2] + 0.1;
    let mut query = |points: &[[f32; 3]]| points.iter().map(plane).collect::<Vec<f32>>();
    let mut grid = DistanceGrid::sphere(24, 3.0, 0.6);
    for offset in 0..4 {
        grid.update_interleaved(offset, 4, &mut query);
    }
    let mut rng = stream(3, Purpose::Samples, 0);
    for _ in 0..200 {
        let p = [0; 3].map(|_| (standard_normal(&mut rng) as f32).clamp(-2.8, 2.8));
        let difference = (grid.lookup(p) - plane(&p)).abs();
        assert!(difference < 1e-5, "{p:?}: {difference}");
    }
    // Beyond the outer nodes their value holds.
    let corner = 3.0 - grid.cell() / 2.0;
    let outside = grid.lookup([100.0, 100.0, 100.0]);
    assert!((outside - plane(&[corner; 3])).abs() < 1e-5);
}

#[test]
fn refreshing_in_turns_reaches_every_node() {
    let config = GridCachedConfig {
        resolution: 6,
        refresh_interval: 2,
        refresh_stride: 3,
        ..GridCachedConfig::default()
    };
    let mut sampler = RaySamplerConfig::GridCached(config).init(SCENE_RADIUS, 0.6);
    let value = |sampler: &RaySampler, expected: f32| {
        let state = sampler.state().expect("a grid is state");
        state.iter().filter(|v| **v == expected).count()
    };
    sampler.refresh(0, &mut |points: &[[f32; 3]]| vec![1.0; points.len()]);
    assert_eq!(
        value(&sampler, 1.0),
        216,
        "everything at the first iteration"
    );
    let mut known = Vec::new();
    for iteration in 1..=6 {
        sampler.refresh(iteration, &mut |points: &[[f32; 3]]| {
            vec![2.0; points.len()]
        });
        known.push(value(&sampler, 2.0));
    }
    assert_eq!(known, [0, 72, 72, 144, 144, 216]);
}
