//! Every part of a training step alone, fused and in plain tensor operations.
//!
//! `cargo bench --workspace --bench parts -- [FILTER]`
//!
//! *Items* are floating-point operations that the part cannot avoid
//! (`neat_train::flops`), so a row's items per second stand beside those of
//! `yardstick`, a large matrix product in the same run. `neat bench` measures
//! whole steps.

use burn::tensor::{Device, Tensor, TensorData};
use divan::Bencher;
use divan::counter::ItemsCount;
use nalgebra::Vector2;
use neat_core::LineSegment2;
use neat_core::assignment::assign;
use neat_field::attraction_region::AttractionRegions;
use neat_pipeline::config::Preset;
use neat_sdf::RayBundle;
use neat_sdf::ray_sampler::Deterministic;
use neat_tensor::host::host_vec;
use neat_tensor::{CoordinateMlp, Field, FieldQuery, GridConfig, Plain, PointEncoding};
use neat_tests::finite_differences::normal;
use neat_train::flops::{StepFlops, StepRows};
use neat_train::model::{ModelConfig, NeatModel};
use rayon::prelude::*;

const PRESETS: [Preset; 2] = [Preset::Fast, Preset::PaperAbc];
const YARDSTICK_SIDE: usize = 2048;

fn main() {
    divan::main();
}

fn matrix(rows: usize, columns: usize, device: &Device) -> Tensor<2> {
    let values: Vec<f32> = normal(rows * columns, 1)
        .into_iter()
        .map(|x| 0.3 * x as f32)
        .collect();
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn yardstick(bencher: Bencher) {
    let a = matrix(YARDSTICK_SIDE, YARDSTICK_SIDE, &Device::flex());
    bencher
        .counter(ItemsCount::new(2 * YARDSTICK_SIDE.pow(3)))
        .bench_local(|| a.clone().matmul(a.clone()));
}

/// Distance networks.
mod network {
    use super::*;

    #[derive(Clone, Copy, Debug)]
    enum Network {
        Fast,
        /// The fast preset's with learned grids, one layer and no sines.
        Grid,
        PaperAbc,
    }

    const NETWORKS: [Network; 3] = [Network::Fast, Network::Grid, Network::PaperAbc];

    impl Network {
        fn config(self) -> ModelConfig {
            let preset = match self {
                Self::Fast | Self::Grid => Preset::Fast,
                Self::PaperAbc => Preset::PaperAbc,
            };
            let mut config = preset.config().model;
            if let Self::Grid = self {
                config.implicit.encoding = PointEncoding::Grid(GridConfig::default());
                config.implicit.octaves = 0;
                config.implicit.hidden_layers = 1;
            }
            config
        }
    }

    struct Setting {
        mlp: CoordinateMlp,
        points: Tensor<2>,
        flops: StepFlops,
    }

    fn setting(network: Network) -> Setting {
        let rows = match network {
            Network::Fast | Network::Grid => 3072,
            Network::PaperAbc => 12_288,
        };
        let config = network.config();
        let device = Device::flex().autodiff();
        let counted = StepRows {
            sampler: rows,
            eikonal: rows,
            ..StepRows::default()
        };
        Setting {
            mlp: NeatModel::new(&config, 1.0, 0, &device)
                .expect("sizes that go together")
                .implicit_network
                .mlp,
            points: matrix(rows, 3, &device),
            flops: StepFlops::count(&config, &counted),
        }
    }

    fn items(flops: f64) -> ItemsCount {
        ItemsCount::new(flops as u64)
    }

    fn query() -> FieldQuery {
        FieldQuery {
            others: true,
            ..FieldQuery::default()
        }
    }

    fn backward(field: Field) {
        let loss = field.first.sum()
            + field.gradient.square().sum()
            + field.others.expect("asked for").sum();
        divan::black_box(loss.backward());
    }

    #[divan::bench(args = NETWORKS, sample_count = 10, sample_size = 1)]
    fn distance_fused(bencher: Bencher, network: Network) {
        let Setting { mlp, points, flops } = setting(network);
        let on_host = mlp.on_host().expect("a CPU backend");
        let points = host_vec(points);
        bencher
            .counter(items(flops.sampler))
            .bench_local(|| on_host.first(&points));
    }

    #[divan::bench(args = NETWORKS, sample_count = 3, sample_size = 1)]
    fn distance_plain(bencher: Bencher, network: Network) {
        let Setting { mlp, points, flops } = setting(network);
        bencher
            .counter(items(flops.sampler))
            .bench_local(|| mlp.forward(points.clone()).narrow(1, 0, 1));
    }

    #[divan::bench(args = NETWORKS, sample_count = 10, sample_size = 1)]
    fn gradient_fused(bencher: Bencher, network: Network) {
        let Setting { mlp, points, flops } = setting(network);
        bencher
            .counter(items(flops.forward))
            .bench_local(|| mlp.field(points.clone(), query()));
    }

    #[divan::bench(args = NETWORKS, sample_count = 3, sample_size = 1)]
    fn gradient_plain(bencher: Bencher, network: Network) {
        let Setting { mlp, points, flops } = setting(network);
        bencher
            .counter(items(flops.forward))
            .bench_local(|| mlp.field_by(&Plain, points.clone(), query()));
    }

    #[divan::bench(args = NETWORKS, sample_count = 10, sample_size = 1)]
    fn training_fused(bencher: Bencher, network: Network) {
        let Setting { mlp, points, flops } = setting(network);
        bencher
            .counter(items(flops.forward + flops.backward))
            .bench_local(|| backward(mlp.field(points.clone(), query())));
    }

    #[divan::bench(args = NETWORKS, sample_count = 3, sample_size = 1)]
    fn training_plain(bencher: Bencher, network: Network) {
        let Setting { mlp, points, flops } = setting(network);
        bencher
            .counter(items(flops.forward + flops.backward))
            .bench_local(|| backward(mlp.field_by(&Plain, points.clone(), query())));
    }
}

/// The sampler of a preset, over rays to a sphere, whose distance costs nothing.
#[divan::bench(args = PRESETS, sample_count = 10, sample_size = 1)]
fn sampler(bencher: Bencher, preset: Preset) {
    let config = preset.config().train;
    let offsets = normal(2 * config.rays, 2);
    let rays = RayBundle {
        origins: offsets
            .chunks_exact(2)
            .map(|o| [0.5 * o[0] as f32, 0.5 * o[1] as f32, -3.0])
            .collect(),
        directions: vec![[0.0, 0.0, 1.0]; config.rays],
    };
    let mut sphere = |points: &[[f32; 3]]| -> Vec<f32> {
        points
            .iter()
            .map(|[x, y, z]| (x * x + y * y + z * z).sqrt() - 0.6)
            .collect()
    };
    let sampler = config.sampler.init(1.0, 0.6);
    bencher.bench_local(|| sampler.sample(&rays, 0.01, &mut sphere, &mut Deterministic));
}

/// So many local junctions against 1024 global ones.
#[divan::bench(args = [50, 200, 600], sample_count = 10, sample_size = 1)]
fn assignment(bencher: Bencher, locals: usize) {
    let cost: Vec<f64> = normal(locals * 1024, 3).into_iter().map(f64::abs).collect();
    bencher.bench_local(|| assign(&cost, locals, 1024).expect("finite costs"));
}

/// Attraction regions of a scene as large as one of DTU.
#[divan::bench(sample_count = 3, sample_size = 1)]
fn regions_of_49_large_views(bencher: Bencher) {
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
    bencher.bench_local(|| -> usize {
        scenes
            .par_iter()
            .map(|segments| AttractionRegions::compute(segments, width, height, 0.0, 10.0).len())
            .sum()
    });
}
