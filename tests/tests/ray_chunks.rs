//! A batch taken in several passes gives the gradients of the batch.

use neat_core::SparsePoint;
use neat_core::synthetic::{SyntheticScene, generate};
use neat_gjp::JunctionCount;
use neat_pipeline::config::Config;
use neat_pipeline::config::Preset;
use neat_tensor::Kernels;
use neat_tests::backends::on_each_cpu_backend;
use neat_tests::comparison::{assert_close_in_l2, assert_relatively_close};
use neat_train::Trainer;

/// Losses of the first step, and the moments that its gradients leave in Adam.
fn train(
    config: &Config,
    chunk: Option<usize>,
    device: &burn::tensor::Device,
) -> (Vec<f64>, Vec<f64>) {
    let synthetic = generate(&SyntheticScene {
        views: 4,
        image_size: 96,
        ..SyntheticScene::default()
    })
    .expect("a valid scene");
    let mut scene = synthetic.scene;
    scene.sparse_points = (synthetic.truth.junctions.iter())
        .map(|junction| SparsePoint {
            position_in_world: *junction,
            observations: Vec::new(),
        })
        .collect();
    let mut config = config.clone();
    config.train.ray_chunk = chunk;
    let mut trainer =
        Trainer::new(&scene, &config.training(Kernels::default()), 0, device).expect("it trains");
    let step = trainer.step(0.1).expect("a step").losses;
    assert!(step.points > 0.0, "the term of sparse points is taken");
    let losses = vec![
        step.total,
        step.rgb,
        step.eikonal,
        step.mask,
        step.segment,
        step.junction_3d,
        step.junction_2d,
        step.points,
    ];
    let parameters = trainer.checkpoint().tensors;
    let parameters = parameters
        .iter()
        .filter(|(name, _)| name.starts_with("adam.first."))
        .flat_map(|(_, data)| data.clone().try_into_vec_as::<f64>().expect("float32"))
        .collect();
    (losses, parameters)
}

fn check(config: &Config) {
    on_each_cpu_backend(|device| {
        let device = device.inner();
        let (losses, moments) = train(config, None, &device);
        // Not so few that a pass has no heavy sample: it would keep its heaviest.
        for chunk in [1000, 40, 20] {
            let (chunked, chunked_moments) = train(config, Some(chunk), &device);
            let what = format!("{chunk} rays at a time");
            assert_relatively_close(&what, &chunked, &losses, 1e-5);
            assert_close_in_l2(&what, &chunked_moments, &moments, 1e-5);
        }
    });
}

#[test]
fn of_the_fast_preset() {
    let mut config = Preset::Fast.config();
    config.train.rays = 64;
    config.train.eikonal.uniform_points = Some(30);
    config.train.junction_interval = 1;
    config.model.background.shells = 3;
    check(&config);
}

#[test]
fn of_a_small_paper_preset() {
    let mut config = Preset::PaperAbc.config();
    config.train.rays = 48;
    config.train.loss.mask = 0.1;
    config.train.loss.points = 0.5;
    config.train.surface_points = 40;
    config.model.implicit.width = 64;
    config.model.implicit.features = 16;
    config.model.rendering.width = 32;
    config.model.attraction.width = 32;
    config.model.perceiver.junctions = JunctionCount::Fixed(32);
    if let neat_sdf::RaySamplerConfig::ErrorBound(sampler) = &mut config.train.sampler {
        sampler.samples = 16;
        sampler.samples_per_iteration = 32;
        sampler.extra_samples = 8;
        sampler.max_iterations = 2;
    }
    check(&config);
}
