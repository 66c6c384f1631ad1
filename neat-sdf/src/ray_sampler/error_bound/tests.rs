//! The sampler against its plain form, bit for bit.

use super::{ErrorBoundConfig, ErrorBoundTrace, StopRule, plain};
use crate::ray_sampler::{Deterministic, RayBundle, RaySamples, SamplingNoise, Seeded};
use neat_tensor::random::{Purpose, stream};

/// A unit sphere, with a bulge so that bounds are not symmetric.
fn distance(p: &[f32; 3]) -> f32 {
    let norm = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    norm - 1.0 + 0.1 * (3.0 * p[0]).sin() * (2.0 * p[2]).cos()
}

fn scene(points: &[[f32; 3]]) -> Vec<f32> {
    points.iter().map(distance).collect()
}

/// A fan of rays over the scene and past it.
fn fan(count: usize) -> RayBundle {
    let mut rays = RayBundle::default();
    for i in 0..count {
        let slope = 1.4 * i as f32 / count as f32 - 0.5;
        let length = (1.0 + slope * slope).sqrt();
        rays.origins.push([0.0, 0.1, -2.5]);
        rays.directions.push([slope / length, 0.0, 1.0 / length]);
    }
    rays
}

fn alone(rays: &RayBundle, ray: usize) -> RayBundle {
    RayBundle {
        origins: vec![rays.origins[ray]],
        directions: vec![rays.directions[ray]],
    }
}

fn seeded() -> impl SamplingNoise {
    Seeded(stream(5, Purpose::Samples, 0))
}

fn bits(z: &[f32]) -> Vec<u32> {
    z.iter().map(|z| z.to_bits()).collect()
}

#[track_caller]
fn assert_identical(what: &str, fused: &RaySamples, plain: &RaySamples) {
    assert_eq!(fused.per_ray, plain.per_ray, "{what}");
    assert_eq!(bits(&fused.z), bits(&plain.z), "{what}");
    assert_eq!(bits(&fused.deltas), bits(&plain.deltas), "{what}");
}

#[test]
fn a_batch_equals_the_plain_form() {
    let rays = fan(61);
    let config = ErrorBoundConfig::default();
    // From "holds at once" to "never holds".
    for beta in [1.0, 0.3, 0.1, 0.05, 0.02, 0.005, 1e-3, 1e-4] {
        for epsilon in [1e-7, 1e-3, 0.1, 2.0] {
            let config = ErrorBoundConfig { epsilon, ..config };
            let what = format!("β {beta}, ε {epsilon}");
            let fused = config.sample(&rays, beta, &mut scene, &mut Deterministic, None);
            let (plain, _) = plain::sample(&config, &rays, beta, &mut scene, &mut Deterministic);
            assert_identical(&what, &fused, &plain);
            let fused = config.sample(&rays, beta, &mut scene, &mut seeded(), None);
            let (plain, _) = plain::sample(&config, &rays, beta, &mut scene, &mut seeded());
            assert_identical(&format!("{what}, seeded"), &fused, &plain);
        }
    }
}

#[test]
fn a_batch_equals_the_plain_form_where_distances_are_not_numbers() {
    let rays = fan(23);
    let config = ErrorBoundConfig::default();
    let mut holes = |points: &[[f32; 3]]| -> Vec<f32> {
        let hole = |p: &[f32; 3]| match (p[2] * 10.0) as i32 {
            3 => f32::NAN,
            5 => f32::INFINITY,
            -7 => 0.0,
            _ => distance(p),
        };
        points.iter().map(hole).collect()
    };
    for beta in [0.1, 0.01] {
        let fused = config.sample(&rays, beta, &mut holes, &mut Deterministic, None);
        let (plain, _) = plain::sample(&config, &rays, beta, &mut holes, &mut Deterministic);
        assert_identical(&format!("β {beta}"), &fused, &plain);
    }
}

#[test]
fn a_ray_that_stops_by_itself_gets_what_it_gets_alone() {
    let rays = fan(61);
    let batch = ErrorBoundConfig::default();
    let each = ErrorBoundConfig {
        stop: StopRule::Ray,
        ..batch
    };
    let mut all_lengths = [0; 6];
    for beta in [0.3, 0.1, 0.05, 0.02, 0.005] {
        let mut asked = 0;
        let mut query = |points: &[[f32; 3]]| {
            asked += points.len();
            scene(points)
        };
        let samples = each.sample(&rays, beta, &mut query, &mut Deterministic, None);
        let mut needed = 0;
        for (ray, z) in samples.z.chunks(samples.per_ray).enumerate() {
            let (plain, iterations) = plain::sample(
                &batch,
                &alone(&rays, ray),
                beta,
                &mut scene,
                &mut Deterministic,
            );
            assert_eq!(bits(z), bits(&plain.z), "β {beta}, ray {ray}");
            all_lengths[iterations] += 1;
            needed += iterations * batch.samples_per_iteration;
        }
        assert_eq!(asked, needed, "β {beta}: only what is needed is asked");
    }
    let different = all_lengths.iter().filter(|rays| **rays > 0).count();
    assert!(different >= 4, "rays by iterations: {all_lengths:?}");
}

#[test]
fn rays_that_stop_by_themselves_repeat_with_the_seed() {
    let rays = fan(61);
    let config = ErrorBoundConfig {
        stop: StopRule::Ray,
        ..ErrorBoundConfig::default()
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().expect("a few threads");
        pool.install(|| config.sample(&rays, 0.02, &mut scene, &mut seeded(), None))
    };
    let once = on(1);
    assert_identical("one thread and four", &on(4), &once);
    assert!(once.z.chunks(once.per_ray).all(<[f32]>::is_sorted));
}

#[test]
fn the_trace_follows_the_rays_that_go_on() {
    let rays = fan(61);
    let config = ErrorBoundConfig {
        stop: StopRule::Ray,
        ..ErrorBoundConfig::default()
    };
    let mut trace = ErrorBoundTrace::default();
    let noise = &mut Deterministic;
    config.sample(&rays, 0.05, &mut scene, noise, Some(&mut trace));
    assert!(trace.beta.len() > 1);
    for (i, beta) in trace.beta.iter().enumerate() {
        let positions = beta.len() * (i + 1) * config.samples_per_iteration;
        assert_eq!(trace.z[i].len(), positions);
        assert_eq!(trace.sdf[i].len(), positions);
        for (beta, error) in beta.iter().zip(&trace.error_at_beta0[i]) {
            assert_eq!(*error <= 0.1, *beta <= 0.05);
        }
    }
    for pair in trace.beta.windows(2) {
        let unfinished = pair[0].iter().filter(|beta| **beta > 0.05).count();
        assert_eq!(pair[1].len(), unfinished);
    }
}

#[test]
fn fewer_first_samples_than_extras_still_give_every_ray_as_many() {
    let rays = fan(31);
    let config = ErrorBoundConfig {
        samples_per_iteration: 20,
        max_iterations: 8,
        stop: StopRule::Ray,
        ..ErrorBoundConfig::default()
    };
    let samples = config.sample(&rays, 0.3, &mut scene, &mut seeded(), None);
    assert_eq!(samples.z.len(), rays.len() * samples.per_ray);
    assert!(samples.z.chunks(samples.per_ray).all(<[f32]>::is_sorted));
}
