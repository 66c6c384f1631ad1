//! A backend may only round differently: the same seed takes the same steps on
//! each.

use neat_core::synthetic::{SyntheticScene, generate};
use neat_lab::compare_backends::compare_backends;
use neat_pipeline::config::Config;
use neat_pipeline::config::Preset;
use neat_pipeline::config::apply_overrides;
use neat_tensor::{Backend, Kernels};
use neat_tests::backends::tested;

const STEPS: u64 = 20;
/// Of a step's total loss, relative. Rounding grows from step to step.
const LOSS_TOLERANCE: f64 = 1e-3;
/// Of one parameter's gradient in the first step, as in the golden training step.
const PER_TENSOR_TOLERANCE: f64 = 1e-4;
/// Of all parameters' gradients together.
const IN_L2_TOLERANCE: f64 = 1e-5;

/// The fast preset with so few points that a software driver takes seconds, and
/// that a ReLU is hardly ever undecided. Where one is, rounding switches a unit at
/// that point: with 256 rays SwiftShader and flex differ in one such unit, by
/// 2·10⁻³ in its row of the gradient where all other units agree to 2·10⁻⁶. No
/// tolerance can tell that from a mistake.
fn config() -> Config {
    let sizes = [
        "train.rays=32",
        "train.eikonal.uniform_points=32",
        "train.sampler.resolution=16",
    ];
    apply_overrides(&Preset::Fast.config(), &sizes.map(str::to_owned)).expect("keys of the preset")
}

#[test]
fn twenty_steps() {
    let synthetic = SyntheticScene {
        views: 12,
        image_size: 128,
        ..SyntheticScene::default()
    };
    let scene = generate(&synthetic).expect("a valid scene").scene;
    let radius = scene.sphere_radius;
    let scene = scene.scaled(1.0 / radius);
    let mut backends = tested(&Backend::built());
    // The reference; the others are compared with it.
    backends.retain(|backend| *backend != Backend::Flex);
    backends.insert(0, Backend::Flex);

    let quiet = &mut |_: &str, _: f64| {};
    let training = config().training(Kernels::default());
    let comparison = compare_backends(&scene, &training, 0, STEPS, &backends, false, quiet)
        .expect("every backend takes every step");
    let table = comparison.to_markdown();
    for result in &comparison.backends {
        let within = result.largest_loss_difference <= LOSS_TOLERANCE
            && result.largest_gradient_difference <= PER_TENSOR_TOLERANCE
            && result.gradient_difference_norm <= IN_L2_TOLERANCE;
        assert!(within, "{} differs:\n{table}", result.backend);
    }
}
