//! Learned grids in all networks: trained, continued, and at their own rate.

use neat_core::Scene;
use neat_core::synthetic::{SyntheticScene, generate};
use neat_pipeline::config::{Config, Preset};
use neat_sdf::RaySamplerConfig;
use neat_sdf::ray_sampler::GridCachedConfig;
use neat_tensor::checkpoint::Checkpoint;
use neat_tensor::{GridConfig, Kernels, PointEncoding};
use neat_tests::backends::on_each_cpu_backend;
use neat_train::Trainer;

const TABLES: [&str; 4] = [
    "model.attraction_network.grid.table",
    "model.background_network.grid.table",
    "model.implicit_network.mlp.grid.table",
    "model.rendering_network.grid.table",
];

fn scene() -> Scene {
    let synthetic = generate(&SyntheticScene {
        views: 4,
        image_size: 64,
        ..SyntheticScene::default()
    });
    synthetic.expect("a valid scene").scene
}

fn with_grids() -> Config {
    let grid = |features, log2_entries| {
        PointEncoding::Grid(GridConfig {
            levels: 3,
            features,
            log2_entries,
            coarsest: 4,
            finest: 32,
        })
    };
    let mut config = Preset::Fast.config();
    config.model.implicit.encoding = grid(1, 8);
    config.model.rendering.encoding = grid(2, 9);
    config.model.attraction.encoding = grid(4, 10);
    config.model.background.shells = 3;
    config.model.background.encoding = grid(2, 8);
    config.train.sampler = RaySamplerConfig::GridCached(GridCachedConfig {
        redraw: true,
        ..GridCachedConfig::default()
    });
    config
}

/// What `steps` steps make of `checkpoint`, or of the start.
fn train(
    config: &Config,
    checkpoint: Option<Checkpoint>,
    steps: usize,
    device: &burn::tensor::Device,
) -> Checkpoint {
    let (scene, config) = (scene(), config.training(Kernels::default()));
    let trainer = match checkpoint {
        Some(checkpoint) => Trainer::resume(&scene, &config, 0, device, checkpoint),
        None => Trainer::new(&scene, &config, 0, device),
    };
    let mut trainer = trainer.expect("it trains");
    for _ in 0..steps {
        trainer.step(0.1).expect("a step");
    }
    trainer.checkpoint()
}

fn tables(checkpoint: &Checkpoint) -> Vec<&[u8]> {
    TABLES
        .map(|name| checkpoint.tensors[name].as_bytes())
        .to_vec()
}

#[test]
fn training_goes_on_where_it_was() {
    on_each_cpu_backend(|device| {
        let config = with_grids();
        let device = device.inner();
        let at_once = train(&config, None, 4, &device);
        let first = train(&config, None, 2, &device);
        let start = train(&config, None, 0, &device);
        let all_moved = tables(&start)
            .iter()
            .zip(tables(&first))
            .all(|(a, b)| *a != b);
        assert!(all_moved, "every table is trained");
        let continued = train(&config, Some(first), 2, &device);
        assert_eq!(continued.metadata, at_once.metadata);
        for (name, tensor) in &at_once.tensors {
            assert_eq!(
                continued.tensors[name].as_bytes(),
                tensor.as_bytes(),
                "{name}"
            );
        }
    });
}

#[test]
fn any_number_of_threads_trains_the_same() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("a few threads");
        let device = neat_tests::backends::flex().inner();
        pool.install(|| train(&with_grids(), None, 3, &device))
    };
    let one = with(1);
    for threads in [2, 5] {
        let same = with(threads);
        for (name, tensor) in &one.tensors {
            assert_eq!(same.tensors[name].as_bytes(), tensor.as_bytes(), "{name}");
        }
    }
}

/// Adam's first step is as long as the rate, whatever the gradient.
#[test]
fn grids_have_a_rate_of_their_own() {
    let device = neat_tests::backends::flex().inner();
    let of_first_step = |factor: f64| {
        let mut config = with_grids();
        config.train.grid_learning_rate = factor;
        let [start, end] = [0, 1].map(|steps| train(&config, None, steps, &device));
        let longest = |name: &str| {
            let [from, to] = [&start, &end].map(|checkpoint| {
                let values = checkpoint.tensors[name].clone().try_into_vec_as::<f32>();
                values.expect("float32")
            });
            let steps = from.iter().zip(&to).map(|(a, b)| (a - b).abs());
            f64::from(steps.fold(0.0, f32::max))
        };
        let weights = longest("model.attraction_network.mlp.layers.0.weight");
        // The columns of the distance's grids start silent, and their table moves later.
        ([TABLES[0], TABLES[1], TABLES[3]].map(longest), weights)
    };
    let (tables, weights) = of_first_step(1.0);
    let (longer, same) = of_first_step(4.0);
    assert!((same / weights - 1.0).abs() < 1e-6, "{same} {weights}");
    for (longer, table) in longer.iter().zip(tables) {
        assert!(
            (longer / table / 4.0 - 1.0).abs() < 0.01,
            "{longer} {table}"
        );
    }
}
