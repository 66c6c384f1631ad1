//! Every part of a training step alone, beside the rate of a large matrix
//! product in the same run, and beside plain tensor operations where a fused
//! operation replaces them.
//!
//! `cargo bench --workspace --bench parts -- [PART]…`
//!
//! A stopwatch of our own: benchmark harnesses would switch on features of shared
//! dependencies, and so build the tensor library twice.

#![allow(clippy::print_stdout)] // a bench prints its table

use burn::tensor::{Device, Tensor, TensorData};
use nalgebra::Vector2;
use neat_core::LineSegment2;
use neat_core::assignment::assign;
use neat_field::attraction_region::AttractionRegions;
use neat_pipeline::flops::{StepFlops, StepRows};
use neat_pipeline::model::{NeatModel, host_vec};
use neat_pipeline::preset::Preset;
use neat_sdf::ray_sampler::Deterministic;
use neat_sdf::{RayBundle, RaySamplerConfig};
use neat_tensor::FieldQuery;
use neat_tests::finite_differences::normal;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

const YARDSTICK_SIDE: usize = 2048;

fn main() {
    let parts: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with("--"))
        .collect();
    let wanted = |part: &str| parts.is_empty() || parts.iter().any(|p| part.contains(p.as_str()));
    let device = Device::flex();
    let yardstick = yardstick(&device);
    println!(
        "{} threads, yardstick {yardstick:.1} GFLOP/s (float32 matrix product, {YARDSTICK_SIDE}³)\n",
        rayon::current_num_threads()
    );
    if wanted("networks") {
        for (preset, rows) in [(Preset::Fast, 3072), (Preset::PaperAbc, 12_288)] {
            networks(preset, rows, yardstick, &device);
        }
    }
    if wanted("samplers") {
        samplers();
    }
    if wanted("assignment") {
        assignment();
    }
    if wanted("regions") {
        regions();
    }
}

/// The shortest of several runs, in seconds.
fn best<T>(runs: usize, mut run: impl FnMut() -> T) -> f64 {
    (0..runs)
        .map(|_| {
            let start = Instant::now();
            black_box(run());
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn matrix(rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = normal(rows * columns, 1)
        .into_iter()
        .map(|x| 0.3 * x as f32)
        .collect();
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

fn yardstick(device: &Device) -> f64 {
    let a = matrix(YARDSTICK_SIDE, YARDSTICK_SIDE, device);
    let seconds = best(5, || a.clone().matmul(a.clone()));
    2.0 * (YARDSTICK_SIDE as f64).powi(3) / seconds / 1e9
}

/// The distance network of a preset: fused against plain.
fn networks(preset: Preset, rows: usize, yardstick: f64, device: &Device) {
    let config = preset.config().model;
    let tracked = device.clone().autodiff();
    let model = NeatModel::new(&config, 1.0, 0, &tracked);
    let mlp = &model.implicit_network.mlp;
    let points = matrix(rows, 3, &tracked);
    let query = || FieldQuery {
        others: true,
        ..FieldQuery::default()
    };
    let flops = StepFlops::count(
        &config,
        &StepRows {
            eikonal: rows,
            ..StepRows::default()
        },
    );
    let report = |what: &str, seconds: f64, flops: f64| {
        let rate = flops / seconds / 1e9;
        println!(
            "{preset} {what}: {:.2} ms, {rate:.1} GFLOP/s, {:.0} %",
            seconds * 1e3,
            100.0 * rate / yardstick
        );
    };
    let host: Vec<f32> = host_vec(points.clone());
    let on_host = mlp.on_host().expect("a CPU backend");
    let distance = StepFlops::count(
        &config,
        &StepRows {
            sampler: rows,
            ..StepRows::default()
        },
    );
    report(
        &format!("distance of {rows} points, fused"),
        best(5, || on_host.first(&host)),
        distance.sampler,
    );
    report(
        "distance, plain",
        best(2, || mlp.forward(points.clone()).narrow(1, 0, 1)),
        distance.sampler,
    );
    let mut seconds = Vec::new();
    for fused in [true, false] {
        let field = || match fused {
            true => mlp.field(points.clone(), query()),
            false => mlp.plain_field(points.clone(), query()),
        };
        let name = if fused { "fused" } else { "plain" };
        let runs = if fused { 5 } else { 2 };
        let forward = best(runs, field);
        report(
            &format!("distance, gradient and features, {name}"),
            forward,
            flops.forward,
        );
        let both = best(runs, || {
            let field = field();
            let loss = field.first.sum()
                + field.gradient.square().sum()
                + field.others.expect("asked for").sum();
            loss.backward()
        });
        report(
            &format!("… and its backward pass, {name}"),
            both,
            flops.forward + flops.backward,
        );
        seconds.push(both);
    }
    println!("{preset} plain / fused: {:.1}\n", seconds[1] / seconds[0]);
}

/// Samplers over rays to a sphere, whose distance costs nothing.
fn samplers() {
    for (preset, count) in [(Preset::Fast, 256), (Preset::PaperAbc, 1024)] {
        let config = preset.config().train.sampler;
        let offsets = normal(2 * count, 2);
        let rays = RayBundle {
            origins: offsets
                .chunks_exact(2)
                .map(|o| [0.5 * o[0] as f32, 0.5 * o[1] as f32, -3.0])
                .collect(),
            directions: vec![[0.0, 0.0, 1.0]; count],
        };
        let mut sphere = |points: &[[f32; 3]]| -> Vec<f32> {
            points
                .iter()
                .map(|[x, y, z]| (x * x + y * y + z * z).sqrt() - 0.6)
                .collect()
        };
        let sampler = config.init(1.0, 0.6);
        let seconds = best(5, || {
            sampler.sample(&rays, 0.01, &mut sphere, &mut Deterministic)
        });
        let kind = match config {
            RaySamplerConfig::ErrorBound(_) => "error-bounded",
            RaySamplerConfig::GridCached(_) => "grid-cached",
            RaySamplerConfig::Uniform(_) => "uniform",
        };
        println!(
            "{preset} {kind} sampler, {count} rays: {:.2} ms",
            seconds * 1e3
        );
    }
    println!();
}

/// Local junctions against 1024 global ones.
fn assignment() {
    for rows in [50, 200, 600] {
        let cost: Vec<f64> = normal(rows * 1024, 3).into_iter().map(f64::abs).collect();
        let seconds = best(5, || assign(&cost, rows, 1024).expect("finite costs"));
        println!(
            "assignment of {rows} to 1024 junctions: {:.2} ms",
            seconds * 1e3
        );
    }
    println!();
}

/// Attraction regions of a scene as large as one of DTU.
fn regions() {
    let (views, segments, width, height) = (49, 400, 1600, 1200);
    let scenes: Vec<Vec<LineSegment2>> = (0..views)
        .map(|view| {
            let numbers = normal(4 * segments, 100 + view);
            numbers
                .chunks_exact(4)
                .map(|n| {
                    let start = Vector2::new(800.0 + 400.0 * n[0], 600.0 + 300.0 * n[1]);
                    LineSegment2::new(start, start + 60.0 * Vector2::new(n[2], n[3]))
                })
                .collect()
        })
        .collect();
    let seconds = best(3, || -> usize {
        scenes
            .par_iter()
            .map(|segments| AttractionRegions::compute(segments, width, height, 0.0, 10.0).len())
            .sum()
    });
    println!(
        "attraction regions, {views} views of {width}×{height}, {segments} segments each: {seconds:.2} s"
    );
}
