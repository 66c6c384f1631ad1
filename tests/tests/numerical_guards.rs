//! Numbers that are none are noticed in the step in which they appear.

use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use neat_core::synthetic::{SyntheticScene, generate};
use neat_pipeline::config::Preset;
use neat_tensor::Kernels;
use neat_tensor::linear::{Linear, LinearInit};
use neat_tensor::parameters::GradientCheck;
use neat_tests::backends::{on_each_backend, on_each_cpu_backend};
use neat_train::{TrainError, Trainer};

/// Whether the gradients of `Σ x W + b` are finite for the input `x` in one row.
fn finite_for(x: [f32; 3], device: &Device) -> bool {
    let init = LinearInit {
        weight: vec![0.5; 6],
        bias: vec![0.0; 2],
    };
    let layer = Linear::new(&init, 3, 2, false, device);
    let output = layer.forward(Tensor::from_data([x], device));
    let mut gradients = GradientsParams::from_grads(output.sum().backward(), &layer);
    GradientCheck::of(&layer, &mut gradients).all_finite()
}

#[test]
fn one_gradient_that_is_no_number_is_enough() {
    on_each_backend(|device| {
        let device = device.autodiff();
        assert!(finite_for([1.0, -2.0, 3.0], &device));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(!finite_for([1.0, bad, 3.0], &device), "{bad}");
        }
    });
}

#[test]
fn a_failed_step_moves_nothing() {
    let scene = generate(&SyntheticScene {
        views: 4,
        image_size: 64,
        ..SyntheticScene::default()
    })
    .expect("a valid scene")
    .scene;
    on_each_cpu_backend(|device| {
        let mut config = Preset::Fast.config();
        // The first step leaves parameters with which the second overflows.
        config.train.learning_rate = 1e30;
        config.train.junction_learning_rate = 1e30;
        config.train.warm_up_steps = 0;
        let mut trainer = Trainer::new(&scene, &config.training(Kernels::default()), 0, &device)
            .expect("it trains");
        trainer.step(0.0).expect("the start is finite");
        let before = trainer.checkpoint();
        let failure = trainer.step(0.0).expect_err("no number");
        assert!(failure.is_numerical(), "{failure}");
        assert!(!TrainError::Config(String::new()).is_numerical());
        assert_eq!(trainer.iteration(), 1);
        let after = trainer.checkpoint();
        assert_eq!(after.metadata, before.metadata);
        for (name, tensor) in &before.tensors {
            // The grid is a cache that each step refreshes before it looks.
            if name != "sampler.grid" {
                assert_eq!(after.tensors[name].as_bytes(), tensor.as_bytes(), "{name}");
            }
        }
    });
}
