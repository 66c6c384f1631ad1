//! Time of the error-bounded sampler on the host, without the network.
//!
//! `cargo bench --workspace --bench error_bound_sampler`
//!
//! The distances are those of a sphere, and what their evaluation takes is left
//! out. A training batch's 1024 rays, in evaluation's even positions.

#![allow(clippy::print_stdout)] // a bench prints its table

use neat_sdf::ray_sampler::{Deterministic, ErrorBoundConfig, RayBundle, StopRule};
use std::time::{Duration, Instant};

const RAYS: usize = 1024;
const REPETITIONS: usize = 9;

/// Rays from (0, 0, −2.5) in a fan: two thirds hit the sphere of radius 1.
fn rays() -> RayBundle {
    let mut rays = RayBundle::default();
    for i in 0..RAYS {
        let slope = 0.65 * i as f32 / RAYS as f32;
        let length = (1.0 + slope * slope).sqrt();
        rays.origins.push([0.0, 0.0, -2.5]);
        rays.directions.push([slope / length, 0.0, 1.0 / length]);
    }
    rays
}

fn sphere(points: &[[f32; 3]]) -> Vec<f32> {
    let distance = |p: &[f32; 3]| (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt() - 1.0;
    points.iter().map(distance).collect()
}

/// Host time of one call, how many distances it asked for, and how often.
fn measure(config: &ErrorBoundConfig, rays: &RayBundle, beta: f32) -> (Duration, usize, usize) {
    let (mut asking, mut distances, mut queries) = (Duration::ZERO, 0, 0);
    let start = Instant::now();
    let mut query = |points: &[[f32; 3]]| {
        let start = Instant::now();
        let answer = sphere(points);
        asking += start.elapsed();
        distances += points.len();
        queries += 1;
        answer
    };
    let samples = config.sample(rays, beta, &mut query, &mut Deterministic, None);
    std::hint::black_box(samples);
    (start.elapsed() - asking, distances, queries)
}

fn main() {
    let rays = rays();
    println!("| stop | β | iterations | distances | host time, median |");
    println!("| --- | --: | --: | --: | --: |");
    for stop in [StopRule::Batch, StopRule::Ray] {
        let config = ErrorBoundConfig {
            stop,
            ..ErrorBoundConfig::default()
        };
        for beta in [0.1, 0.01, 0.001] {
            let mut runs: Vec<_> = (0..REPETITIONS)
                .map(|_| measure(&config, &rays, beta))
                .collect();
            runs.sort();
            let (time, distances, iterations) = runs[REPETITIONS / 2];
            let time = time.as_secs_f64() * 1e3;
            println!("| {stop:?} | {beta} | {iterations} | {distances} | {time:.1} ms |");
        }
    }
}
